"""Checks of a belief: its covariance against its errors."""
