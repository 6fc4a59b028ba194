"""slamreplay in a notebook: bundles, runs and reports as values that show themselves."""
