"""SR-CON-010: a covariance that shrank or stood while it should have grown."""
