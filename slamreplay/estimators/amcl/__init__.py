"""Adaptive Monte Carlo localization as nav2_amcl does it, replayable bit by bit."""
