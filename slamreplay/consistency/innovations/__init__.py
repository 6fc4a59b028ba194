"""Checks of what measurements said against an estimator's predictions."""
