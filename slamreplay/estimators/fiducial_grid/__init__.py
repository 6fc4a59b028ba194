"""Wheels and codes in the floor: how mobile drive units know where they are.

A camera that looks down reads 2-D barcodes in a grid, each of which tells x, y and heading; between
them wheels carry the pose (Wurman, D'Andrea and Mountz 2008, Coordinating hundreds of cooperative,
autonomous vehicles in warehouses).
"""
