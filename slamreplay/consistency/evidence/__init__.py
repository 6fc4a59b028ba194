"""What a belief is held against: its errors by source, each with an honest covariance."""
