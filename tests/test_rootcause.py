"""Incidents with one known cause: which single thing, put back, reproduces them."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from slamreplay.bench.incidents import incident
from slamreplay.bench.logs import bundle_of
from slamreplay.bundle.belief import belief_times, recorded_belief
from slamreplay.bundle.products import Hindsight
from slamreplay.bundle.tables import Table
from slamreplay.bundle.track import PoseTrack
from slamreplay.perturb import PERTURBATIONS
from slamreplay.rootcause.answer import root_cause
from slamreplay.rootcause.mode import mode_of
from slamreplay.rootcause.result import Candidate, RootCause
from slamreplay.verdict.judgement import FailureMode

#: Kind of incident, its seed, and what it began as.
KNOWN = [
    ("wrong_start", 601, "wrong_initial_pose"),
    ("wheel_slip", 601, "odometry_slip"),
    ("kidnapped", 500, "kidnapped"),
    ("vague_start", 601, "sensing_ambiguity"),
    ("no_matches", 601, "optimization_drift"),
    ("too_sure", 600, "overconfidence"),
    ("clock_off", 600, "timing"),
    ("escort", 600, "association_error"),
]


@cache
def log_of(kind: str, seed: int):
    """A simulated log, its belief, and a hindsight as good as it gets: the truth."""
    bundle, truth = bundle_of(incident(kind, seed))
    view = bundle.view()
    n = len(truth.t_ns)
    cov = np.tile(np.diag([4e-4, 4e-4, 1e-4]), (n, 1, 1))
    track = PoseTrack("map", "base_link", truth.t_ns, truth.xyyaw_taken, cov)
    found = Hindsight(track, 0.02, 1.0, np.full(n, 0.9), None, None)
    return view, recorded_belief(view, belief_times(view)), found


@cache
def answer_of(kind: str, seed: int):
    return root_cause(*log_of(kind, seed))


def without_odometry(view, belief, found):
    transforms = view.table("transforms")
    still = transforms.take(transforms["is_static"])
    nothing = Table.empty(view.table("odometry").schema)
    return view.with_table(nothing).with_table(still), belief, found


@pytest.mark.parametrize(("kind", "seed", "began_as"), KNOWN)
def test_an_incident_is_traced_to_its_cause(kind, seed, began_as):
    cause = answer_of(kind, seed)

    assert cause is not None
    assert cause.began_as == began_as
    assert cause.probability > 0.6
    assert sum(c.probability for c in cause.candidates) == pytest.approx(1.0)
    names = [c.perturbation for c in cause.candidates if c.perturbation]
    for name, _, variant in (full.partition(".") for full in names):
        assert variant in PERTURBATIONS.load(name).variants


def test_nothing_is_asked_where_nothing_failed():
    view, belief, found = log_of("wheel_slip", 601)
    right = PoseTrack("map", "base_link", belief.t_ns, found.track.xyyaw.copy(), belief.cov)

    assert root_cause(view, right, found) is None


def test_without_odometry_a_wrong_start_is_still_found():
    start = root_cause(*without_odometry(*log_of("wrong_start", 601)))
    slip = root_cause(*without_odometry(*log_of("wheel_slip", 601)))

    assert start.began_as == "wrong_initial_pose"
    assert slip.began_as in ("none", "kidnapped", "odometry_slip")
    assert slip.probability is None or slip.probability < 0.9
    assert "no odometry" in slip.reason


def test_a_wrong_pose_that_somebody_set_on_the_way_is_found():
    view, belief, found = log_of("wheel_slip", 601)
    rows = np.flatnonzero(belief.t_ns >= belief.t_ns[0] + 8_000_000_000)
    xyyaw = found.track.xyyaw.copy()
    wrong = xyyaw[rows] + np.array([0.0, 2.5, 0.0])
    xyyaw[rows] = wrong
    table = view.table("initial_poses")
    position, angle = np.array([[*wrong[0, :2], 0.0]]), wrong[0, 2] / 2.0
    t_ns = belief.t_ns[rows[:1]]
    late = table.take([0]).replace(
        t_ns=t_ns,
        t_log_ns=t_ns + (table["t_log_ns"][0] - table.t_ns[0]),
        position_xyz=position,
        orientation_xyzw=np.array([[0.0, 0.0, np.sin(angle), np.cos(angle)]]),
    )
    set_late = view.with_table(Table.concat(table.schema, [table, late]))
    said = PoseTrack("map", "base_link", belief.t_ns, xyyaw, belief.cov)

    cause = root_cause(set_late, said, found)

    assert cause.began_as == "wrong_initial_pose"
    best = cause.candidates[0]
    assert best.level == pytest.approx(2.5, abs=0.2)
    assert "the pose that was set at" in best.text


def test_the_same_log_gives_the_same_answer():
    assert root_cause(*log_of("wrong_start", 601)) == answer_of("wrong_start", 601)


def cause_of(kind, probability=0.9, trials=20):
    one = Candidate(kind, None, None, "", None, -1.0, probability, "with it 3 m off")
    return RootCause(0, 1, kind, probability, (one,), trials)


def test_the_failure_mode_follows_replays_and_says_where_it_differs():
    read_off = FailureMode("odometry_slip", 0.8, ("the wheels parted",))

    same = mode_of(cause_of("odometry_slip"), read_off)
    other = mode_of(cause_of("timing"), read_off)
    nothing = mode_of(cause_of("none"), read_off)
    untried = mode_of(cause_of("timing", trials=0), read_off)

    assert (same.kind, same.confidence) == ("odometry_slip", 0.9)
    assert same.evidence[0] == "the wheels parted"
    assert other.kind == "timing"
    assert "without replays it looks like odometry slip" in other.evidence[1]
    assert nothing.kind == "odometry_slip"
    assert "no single thing" in nothing.evidence[-1]
    assert untried == read_off
