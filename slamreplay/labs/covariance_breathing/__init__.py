"""How the covariance of a pose breathes along a corridor, and how it collapses."""
