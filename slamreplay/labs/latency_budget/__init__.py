"""Whether poses come fresh enough for planner and controller, and what one more stage would do."""
