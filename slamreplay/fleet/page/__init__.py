"""fleet.html: what a fleet team opens in the morning, one file."""
