"""Checks of the log itself: clocks, transforms, numbers, and what is missing."""
