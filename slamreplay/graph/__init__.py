"""Pose graphs on GTSAM; the only package that imports it."""
