"""One drive in worlds that differ in one thing: what parts a lost robot from a changed aisle."""
