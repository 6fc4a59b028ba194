"""What errors that hang together in time can tell: intervals, tests, distributions."""
