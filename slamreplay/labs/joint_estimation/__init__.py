"""Mapping and localization in sequence against both at once, from the same evidence."""
