"""A log without one of the eight parts of a replay bundle: which question loses its answer."""
