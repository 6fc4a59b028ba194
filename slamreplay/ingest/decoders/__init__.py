"""One file for each family of message types: what its fields mean, as rows of a table."""
