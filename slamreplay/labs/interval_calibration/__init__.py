"""How often the intervals of mean NEES cry wolf, and what they find."""
