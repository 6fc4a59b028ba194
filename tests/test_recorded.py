"""The localizer of the log stands beside the estimators that are run again."""

import numpy as np
import pytest

from slamreplay.audit.log_audit import LogAudit
from slamreplay.bundle.belief import recorded_belief
from slamreplay.bundle.run import run_bytes
from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.store import write_bundle
from slamreplay.errors import NotApplicableError
from slamreplay.estimators.recorded import Recorded, RecordedPose, RecordedTf, recorded_names
from slamreplay.geometry import se2
from slamreplay.geometry.times import ns
from slamreplay.replay.design import design, usual_estimators
from slamreplay.replay.runner import replay
from slamreplay.testing import edits, synthetic_bundle
from slamreplay.testing.synthetic_rows import START_NS

JUMP = (0.6, 0.0, 0.2)
FROM_S = 4.0


@pytest.fixture(scope="module")
def jumping():
    return synthetic_bundle(seconds=8.0, belief_offset_xyyaw=JUMP, offset_from_s=FROM_S)


def parted(bundle):
    """The poses say something else than tf does."""
    poses = bundle.table("poses")
    there = poses["position_xyz"] + np.array([0.5, 0.0, 0.0])
    return edits.rebuilt(bundle, {"poses": poses.replace(position_xyz=there)})


@pytest.mark.parametrize("estimator", [Recorded(), RecordedPose(), RecordedTf()])
def test_each_word_moves_the_belief_by_what_it_jumped(jumping, estimator):
    estimate = estimator.run(jumping.view(), seed=0)
    (ledger,) = estimate.innovations

    step = np.hypot(ledger.moved[:, 0], ledger.moved[:, 1])
    largest = int(np.nanargmax(step))
    assert len(ledger.t_ns) == 16
    assert ledger.t_ns[largest] == START_NS + ns(FROM_S)
    assert step[largest] == pytest.approx(0.6, abs=0.06)
    assert ledger.moved[largest, 2] == pytest.approx(0.2, abs=0.03)
    assert np.nanmax(np.delete(step, largest)) < 0.1
    assert np.isnan(ledger.moved[0]).all()  # nothing was believed before it
    assert not ledger.is_predicted
    assert np.isnan(ledger.residual).all()
    assert ledger.accepted.all()


def test_it_moved_as_the_audit_of_tf_says(jumping):
    (ledger,) = RecordedTf().run(jumping.view(), seed=0).innovations
    steps = LogAudit(jumping.view()).corrections.at_robot

    assert ledger.t_ns[1:].tolist() == steps.t_ns.tolist()
    np.testing.assert_allclose(np.hypot(*ledger.moved[1:, :2].T), steps.metres, atol=1e-8)
    np.testing.assert_allclose(np.abs(ledger.moved[1:, 2]), steps.radians, atol=1e-8)


def test_its_rows_are_the_belief_at_the_scans(jumping):
    estimate = Recorded().run(jumping.view(), seed=0)

    belief = recorded_belief(jumping.view(), jumping.table("scans").t_ns)
    np.testing.assert_array_equal(estimate.track.xyyaw, belief.xyyaw)
    np.testing.assert_array_equal(estimate.track.cov, belief.cov)
    assert estimate.diagnostics["updated"].sum() == 16


def test_a_word_that_is_repeated_on_tf_is_one(jumping):
    tf = jumping.table("transforms")
    of_localizer = np.flatnonzero(tf["child_frame"] == "odom")
    again = tf.take(np.repeat(of_localizer, 3))
    later = again["t_log_ns"] + np.tile([0, 100_000_000, 200_000_000], len(of_localizer))
    tf = type(tf).concat(TABLES["transforms"], [tf, again.replace(t_log_ns=later)])

    (ledger,) = (
        RecordedTf().run(edits.rebuilt(jumping, {"transforms": tf}).view(), seed=0).innovations
    )

    assert len(ledger.t_ns) == 16


def test_without_odometry_nobody_knows_how_far_a_word_moved_it(jumping):
    (ledger,) = Recorded().run(edits.without(jumping, "odometry").view(), seed=0).innovations

    assert len(ledger.t_ns) == 16
    assert np.isnan(ledger.moved).all()


def test_tf_and_poses_are_two_only_where_they_differ(jumping):
    assert recorded_names(jumping.view()) == ("recorded",)
    assert recorded_names(parted(jumping).view()) == ("recorded_tf", "recorded_pose")
    assert recorded_names(edits.without(jumping, "localizer").view()) == ()
    one, other = (
        e.run(parted(jumping).view(), seed=0).track for e in (RecordedTf(), RecordedPose())
    )
    apart = (one.xyyaw - other.xyyaw)[other.has_pose & one.has_pose]
    assert np.hypot(*apart[:, :2].T) == pytest.approx(np.full(len(apart), 0.5), abs=0.1)
    with pytest.raises(NotApplicableError, match="no localizer spoke"):
        Recorded().run(edits.without(jumping, "localizer").view(), seed=0)


def test_it_stands_beside_the_others_and_no_perturbation_is_passed_off_as_its_baseline(
    jumping, tmp_path
):
    assert "recorded" in usual_estimators(jumping)
    assert not {"recorded_tf", "recorded_pose"} & set(usual_estimators(jumping))
    assert "recorded" not in usual_estimators(edits.without(jumping, "localizer"))
    asked = ["scan_drop.even=0.5", "odometry_scale=1.1", "tf_delay.all=0.5", "initial_pose=1"]

    baseline, *perturbed = replay(jumping, design(jumping, ["recorded"], asked, 0))

    assert baseline.estimate is not None
    assert [run.estimate for run in perturbed] == [None] * 4
    assert all("recorded, cannot be run again" in str(run.not_applicable) for run in perturbed)


def test_recorded_poses_move_with_the_map_frame(jumping):
    there = Recorded().run(edits.moved(jumping, np.array([3.0, -2.0, 1.0])).view(), seed=0)
    here = Recorded().run(jumping.view(), seed=0)

    off = se2.between(se2.compose(np.array([3.0, -2.0, 1.0]), here.track.xyyaw), there.track.xyyaw)
    assert np.nanmax(np.abs(off)) < 1e-9


def test_a_report_asks_the_recorded_belief_once(tmp_path, jumping):
    from slamreplay.bundle.view import Bundle
    from slamreplay.postmortem import postmortem

    tables = {name: jumping.table(name) for name in TABLES}
    write_bundle(tmp_path / "b", jumping.manifest, tables, {"room": jumping.grid()})
    bundle = Bundle.open(tmp_path / "b")
    runs = replay(bundle, design(bundle, ["recorded"], [], 0))

    post = postmortem(bundle, runs)

    assert run_bytes(post.trials[0].run) == run_bytes(runs[0])
    assert not [f for f in post.findings if f.message.startswith("recorded")]
