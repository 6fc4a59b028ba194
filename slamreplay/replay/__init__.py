"""Trials: the same evidence, at most one perturbation, an estimator and a seed."""
