"""An extended Kalman filter on wheel odometry and sightings of things with a surveyed place."""
