"""Replay the evidence of a robot log and say whether the robot was lost or the map had changed."""

__version__ = "0.1.0"
