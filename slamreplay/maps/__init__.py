"""Occupancy grids: files, versions, likelihood fields and rays."""
