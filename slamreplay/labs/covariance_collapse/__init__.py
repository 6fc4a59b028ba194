"""Process noise told too low: a tight covariance, a growing error, and who finds it."""
