"""Closures that are false, over the score that they need to be taken."""
