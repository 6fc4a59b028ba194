"""Names of topics: the file's writer and its layout agree on them here."""

from __future__ import annotations

from slamreplay.evidence.scene import LaneKey

ROOT = "/slamreplay"

TRANSFORMS = f"{ROOT}/transforms"
MAP = f"{ROOT}/map"
CHANGED_CELLS = f"{ROOT}/changed/cells"
CHANGED_REGIONS = f"{ROOT}/changed/regions"
STOPS = f"{ROOT}/stops"
PARTING = f"{ROOT}/parting"
PLAN = f"{ROOT}/plan"
PARTICLES = f"{ROOT}/particles"
FINDINGS = f"{ROOT}/findings"
STATE = f"{ROOT}/state"
VERDICT = f"{ROOT}/verdict"

#: Of the two robots, by who is asked.
BELIEF, HINDSIGHT = f"{ROOT}/belief", f"{ROOT}/hindsight"


def pose(robot: str) -> str:
    """The poses of one robot."""
    return f"{robot}/pose"


def path(robot: str) -> str:
    """Its path over the whole window."""
    return f"{robot}/path"


def ellipse(robot: str) -> str:
    """Its covariance ellipse."""
    return f"{robot}/ellipse"


def outline(robot: str) -> str:
    """Its footprint."""
    return f"{robot}/footprint"


def scan(robot: str, laser: int) -> str:
    """What a laser saw, drawn from that robot; lasers are numbered from 1."""
    return f"{robot}/scan" if laser == 1 else f"{robot}/scan_{laser}"


def lane(key: LaneKey) -> str:
    """One number over time."""
    return f"{ROOT}/{key}"


def run(name: str) -> str:
    """A replayed estimator."""
    return f"{ROOT}/runs/{name}"
