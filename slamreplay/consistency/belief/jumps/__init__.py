"""Jumps of a belief: where its path steps as the robot did not move, and what made it."""
