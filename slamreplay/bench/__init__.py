"""The public benchmark: simulated incidents from seeds, judged, and scored against the truth."""
