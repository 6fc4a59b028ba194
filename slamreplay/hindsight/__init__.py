"""Where the robot really was, rebuilt from the whole log, and what of the map was not true."""
