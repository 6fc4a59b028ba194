"""Scans against maps and against each other: score fields, window search, whole-map search."""
