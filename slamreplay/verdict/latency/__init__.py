"""How old the pose was when planner and controller used it, and what an added stage would do."""
