"""Belief, hindsight and what the robot did, weighed: was it lost, or had the world changed?

`judge.judge` is the way in; what it hands back is in `judgement`, its thresholds in `limits`.
"""
