"""Wheels that slip in a recorded bag, and what beliefs make of it by themselves."""
