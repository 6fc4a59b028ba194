"""The logs that come with the project, and the page that says what they are."""

from __future__ import annotations

from slamreplay.simulate import SCENARIOS
from slamreplay.simulate.scenarios import scenario

#: File name to the scenario it shows.
SAMPLES = {
    "healthy.mcap": "healthy",
    "lost_robot.mcap": "lost_robot",
    "wheel_slip.mcap": "wheel_slip",
    "changed_aisle.mcap": "changed_aisle",
    "lost_in_changed_aisle.mcap": "lost_in_changed_aisle",
    "corridor_100m.mcap": "corridor_100m",
    "healthy_short.db3": "healthy_short",
    "healthy_short.bag": "healthy_short",
}

_TEXT = """# Sample logs

Made by the project's own simulator, no robot was there. This command makes them all anew, byte for
byte on one machine; `slamreplay simulate SCENARIO -o LOG` makes one.

    slamreplay simulate --samples -o sample_logs

| log | scenario | seed | expected verdict | what happens |
|---|---|---|---|---|
{rows}

The expected verdict follows from the truth by the definitions of the report (lost: the belief is
more than 0.5 m or 20 deg off for 3 s or longer; changed: more than 8 % of the valid beams for 2 s
or longer; 5 s in all of either decide); a test computes it from these files. In `wheel_slip` the
robot is lost for a part of the log and finds back by itself.

Each log holds `/scan` (271 beams, 10 Hz), `/odom`, `/imu`, `/tf`, `/tf_static`, `/map`,
`/initialpose`, `/amcl_pose`, `/local_costmap/costmap`, `/cmd_vel`, `/plan`, `/behavior_tree_log`,
and the truth as `/slamreplay/reference`, which only metrics may read. Ranges come in steps of
1/1024 m.
"""


def readme() -> str:
    """The page beside the sample logs."""
    rows = []
    for file_name, name in SAMPLES.items():
        made = scenario(name)
        rows.append(f"| {file_name} | {name} | {made.seed} | {made.verdict} | {SCENARIOS[name]} |")
    return _TEXT.format(rows="\n".join(rows))
