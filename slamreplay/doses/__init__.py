"""Designs on one log: how much of each perturbation it takes until each estimator breaks."""
