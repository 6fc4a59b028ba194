"""What a post-mortem found, as one value: what reports, exports and notebooks are made from."""
