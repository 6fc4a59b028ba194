"""How it began, what the clocks and the wheels did, and the belief that actions were built on."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from handmade import at_scans, hindsight_of, shares_between

from slamreplay.bundle.belief import recorded_belief
from slamreplay.bundle.odometry import odometry_track
from slamreplay.bundle.products import Hindsight
from slamreplay.bundle.run import Trial
from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.tables import Table
from slamreplay.bundle.track import PoseTrack
from slamreplay.geometry import se2, se3
from slamreplay.geometry.times import ns
from slamreplay.ingest.pipeline import ingest
from slamreplay.perturb import PERTURBATIONS
from slamreplay.perturb.scan_delay import ScanDelay
from slamreplay.perturb.tf_delay import TfDelay
from slamreplay.replay.runner import run_trial
from slamreplay.testing.synthetic import START_NS, synthetic_bundle, true_path
from slamreplay.verdict.actions import Outcome, actions, risky
from slamreplay.verdict.belief_error import belief_error
from slamreplay.verdict.case import Case
from slamreplay.verdict.confidence import calibrated, confidence
from slamreplay.verdict.contract import contract_findings
from slamreplay.verdict.judge import judge
from slamreplay.verdict.limits import Limits
from slamreplay.verdict.map_frame import constant_offset
from slamreplay.verdict.scan_gaps import scan_gaps
from slamreplay.verdict.summary import MOST_CHARACTERS
from slamreplay.verdict.timing import Delay, scan_delay
from slamreplay.verdict.wander import is_pulled_back
from slamreplay.verdict.wheels import Wheels, wheels
from slamreplay.verdict.words import square_metres

LIMITS = Limits()
SAMPLES = Path(__file__).parents[1] / "sample_logs"


def dead_reckoned(bundle):
    """The belief of a robot that trusts its wheels from the true start on."""
    t = at_scans(bundle)
    odom = odometry_track(bundle.view()).at(t).xyyaw
    start = true_path(np.zeros(1))[0]
    xyyaw = se2.compose(start, se2.between(odom[0], odom))
    return PoseTrack.without_covariance("map", "base_link", t, xyyaw)


def rows(table, t_s, **columns):
    t = START_NS + np.array([ns(s) for s in t_s], dtype=np.int64)
    times = {"t_ns": t, "t_sensor_ns": t, "t_log_ns": t}
    columns = {"topic": [f"/{table}"] * len(t), **columns}
    return Table(TABLES[table], {**times, **columns})


def recovering(t_s, name="Spin", status="running"):
    return rows(
        "recoveries",
        t_s,
        name=[name] * len(t_s),
        status=[status] * len(t_s),
        goal=[""] * len(t_s),
        source=["behavior_tree"] * len(t_s),
    )


def standing(bundle, from_s, until_s):
    """The bundle's view with an odometry that rests for a while and then goes on."""
    table = bundle.table("transforms")
    t = (table.t_ns - START_NS) / 1e9
    odom = np.flatnonzero(table["child_frame"] == "base_link")
    held_s = np.where(t < from_s, t, np.maximum(from_s, t - (until_s - from_s)))
    path = true_path(held_s[odom])
    position = table["translation_xyz"].copy()
    rotation = table["rotation_xyzw"].copy()
    position[odom, :2] = path[:, :2]
    rotation[odom] = se3.quaternion_from_yaw(path[:, 2])
    return bundle.view().with_table(table.replace(translation_xyz=position, rotation_xyzw=rotation))


def judged(bundle, hindsight=None):
    view = bundle.view()
    hindsight = hindsight_of(bundle) if hindsight is None else hindsight
    return judge(view, recorded_belief(view, at_scans(bundle)), hindsight)


# --- clocks ----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    """A simulated log with real turns, and where the robot really was as hindsight."""
    bundle = ingest([SAMPLES / "healthy.mcap"], tmp_path_factory.mktemp("late") / "b")
    truth = bundle.table("references")
    yaw = se3.yaw_from_quaternion(truth["orientation_xyzw"])
    xyyaw = np.column_stack([truth["position_xyz"][:, :2], yaw])
    return bundle, PoseTrack.without_covariance("map", "base_link", truth.t_ns, xyyaw)


def seen_from(view, truth, late_s=0.0):
    """Hindsight of scans that were taken `late_s` before their stamps."""
    t = view.role("scan").t_ns
    poses = truth.at(t - ns(late_s)).xyyaw
    cov = np.tile(np.diag([1e-3, 1e-3, 1e-4]), (len(t), 1, 1))
    track = PoseTrack("map", "base_link", t, poses, cov)
    return Hindsight(track, 0.03, 1.0, np.full(len(t), 0.95), 0.3, None)


@pytest.mark.parametrize(("late_s", "within_s"), [(0.08, 0.02), (0.3, 0.02), (1.0, 0.05)])
def test_late_scans_are_measured_in_milliseconds(drive, late_s, within_s):
    bundle, truth = drive
    view = ScanDelay().apply(bundle.view(), "stamp", late_s, np.random.default_rng(0))
    delay = scan_delay(view, seen_from(view, truth, late_s))

    assert delay.seconds == pytest.approx(late_s, abs=within_s)
    assert (delay.late, delay.is_significant, delay.sigma_s < 0.01) == ("scans", True, True)
    assert f"{1e3 * delay.seconds:.0f} ms" in delay.text


def test_late_odometry_is_told_from_late_scans_by_the_imu(drive):
    bundle, truth = drive
    view = TfDelay().apply(bundle.view(), "odometry", 0.15, np.random.default_rng(0))
    delay = scan_delay(view, seen_from(view, truth))

    assert delay.seconds == pytest.approx(-0.15, abs=0.02)
    assert (delay.late, delay.witness) == ("odometry", "IMU")


def test_a_log_in_time_has_no_delay_and_a_log_without_turns_says_nothing(drive):
    bundle, truth = drive
    delay = scan_delay(bundle.view(), seen_from(bundle.view(), truth))
    ellipse = synthetic_bundle()

    assert not delay.is_significant
    assert abs(delay.seconds) < 0.015
    assert scan_delay(ellipse.view(), hindsight_of(ellipse)) is None


def test_late_stamps_alone_make_nobody_lost(drive):
    bundle, truth = drive
    late_s = 0.4
    view = ScanDelay().apply(bundle.view(), "stamp", late_s, np.random.default_rng(0))
    belief = recorded_belief(view, view.role("scan").t_ns)
    hindsight = seen_from(view, truth, late_s)
    judgement = judge(view, belief, hindsight)
    blind = belief_error(belief, hindsight, LIMITS)
    told = belief_error(belief, hindsight, LIMITS, ns(late_s))

    assert (judgement.state, judgement.failure_mode.kind) == ("healthy", "timing")
    assert "SR-CLK-002" in [f.id for f in judgement.findings]
    assert np.nanmedian(told.distance_m) < 0.6 * np.nanmedian(blind.distance_m)


# --- wheels ----------------------------------------------------------------------------------


def test_slip_says_when_how_far_and_in_which_way():
    bundle = synthetic_bundle(seconds=30)
    t = (at_scans(bundle) - START_NS) / 1e9
    slow = np.interp(t, [0, 10, 14, 40], [0, 10, 11.3, 37.3])
    hindsight = hindsight_of(bundle, xyyaw=true_path(slow))
    found = wheels(bundle.view(), belief_error(dead_reckoned(bundle), hindsight, LIMITS))
    slip = found.slips[0]

    assert slip.model == "spinning"
    assert (slip.start_ns - START_NS) / 1e9 == pytest.approx(10.0, abs=0.6)
    assert (slip.end_ns - START_NS) / 1e9 == pytest.approx(14.0, abs=0.6)
    assert slip.counted_m - slip.moved_m == pytest.approx(0.5 * 2.7, abs=0.3)
    assert found.calibration_words == ()


def test_a_turn_that_wheels_do_not_see_is_rotational_slip():
    bundle = synthetic_bundle(seconds=30)
    t = (at_scans(bundle) - START_NS) / 1e9
    path = true_path(t)
    turn = np.interp(t, [0, 12, 13, 40], [0, 0, 0.5, 0.5])
    pivot = path[120]
    turned = se2.compose(
        pivot, se2.compose(np.column_stack([0 * t, 0 * t, turn]), se2.between(pivot, path))
    )
    hindsight = hindsight_of(bundle, xyyaw=turned)
    found = wheels(bundle.view(), belief_error(dead_reckoned(bundle), hindsight, LIMITS))

    assert [s.model for s in found.slips] == ["turning"]
    assert found.slips[0].radians == pytest.approx(0.5, abs=0.1)


def test_a_wrong_scale_is_calibration_and_no_slip():
    bundle = synthetic_bundle(seconds=60)
    hindsight = hindsight_of(bundle)
    track = hindsight.track
    longer = track.xyyaw * np.array([1.1, 1.1, 1.0])
    hindsight = replace(
        hindsight, track=PoseTrack("map", "base_link", track.t_ns, longer, track.cov)
    )
    found = wheels(bundle.view(), belief_error(None, hindsight, LIMITS))

    assert found.slips == ()
    assert found.scale == pytest.approx(1 / 1.1, abs=0.02)
    assert "too little way" in found.calibration_words[0]


def test_odometry_is_put_to_scale_before_it_is_held_against_the_robot():
    way = true_path(np.linspace(0.0, 30.0, 301))
    steps = se2.between(way[:-1], way[1:])
    told = [way[0]]
    for forward, side, turn in steps:
        worn = np.array([1.1 * forward, 1.1 * side, 1.07 * (turn + 0.03 * forward)])
        told.append(se2.compose(told[-1], worn))
    told = np.array(told)
    told[40] = np.nan
    known = Wheels(1.1, 0.001, 1.07, 0.001, 0.03, ())

    mended = known.mended(told)

    assert np.isnan(mended[40]).all()
    off = np.abs(mended - way)[np.arange(301) != 40]
    assert off[:, :2].max() < 0.03 < np.nanmax(np.abs(told - way)[:, :2])
    noise = Wheels(1.1, 0.1, 1.07, 0.1, 0.001, ())
    assert noise.mended(told) == pytest.approx(told, nan_ok=True)


# --- how it began ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("turned_deg", "shoved_m", "kind"),
    [(60.0, 0.0, "kidnapped"), (0.0, 1.2, "kidnapped"), (0.0, -1.5, "odometry_slip")],
)
def test_a_robot_that_moved_more_than_its_wheels_was_pushed(turned_deg, shoved_m, kind):
    bundle = synthetic_bundle(seconds=40, with_initial_pose=False)
    view = standing(bundle, 12.0, 18.0) if turned_deg else bundle.view()
    t = (at_scans(bundle) - START_NS) / 1e9
    odom = odometry_track(view).at(at_scans(bundle)).xyyaw
    start = true_path(np.zeros(1))[0]
    told = se2.compose(start, se2.between(odom[0], odom))
    belief = PoseTrack.without_covariance("map", "base_link", at_scans(bundle), told)
    # Turned where it stands; shoved on, or spinning, along its way.
    along = np.interp(t, [0, 14, 17, 40], [0.0, 0.0, shoved_m, shoved_m]) / 0.5
    way = told if turned_deg else true_path(t + along)
    pivot = told[np.searchsorted(t, 14.0)]
    yaw = np.radians(np.interp(t, [0, 14, 15.5, 40], [0.0, 0.0, turned_deg, turned_deg]))
    turned = np.column_stack([0 * t, 0 * t, yaw])
    real = se2.compose(pivot, se2.compose(turned, se2.between(pivot, way)))
    mode = judge(view, belief, hindsight_of(bundle, xyyaw=real)).failure_mode

    assert mode.kind == kind, mode.evidence


@pytest.mark.parametrize(
    ("sigma_m", "kind"), [(2.0, "sensing_ambiguity"), (0.5, "wrong_initial_pose")]
)
def test_a_first_pose_that_is_as_vague_as_it_was_told_is_no_wrong_one(sigma_m, kind):
    bundle = synthetic_bundle(seconds=30)
    t = (at_scans(bundle) - START_NS) / 1e9
    belief = recorded_belief(bundle.view(), at_scans(bundle))
    sigma = np.where(t < 2.0, sigma_m, 0.1) + 1e-6 * t
    cov = np.einsum("n,ij->nij", sigma**2, np.eye(3))
    off = true_path(t) + np.outer(np.where(t < 15.0, 2.6, 0.0), [1.0, 0.0, 0.0])
    away = PoseTrack("map", "base_link", belief.t_ns, off, cov)

    assert judge(bundle.view(), away, hindsight_of(bundle)).failure_mode.kind == kind


@pytest.mark.parametrize(("off_m", "late_s", "is_so"), [(0.6, 0.8, True), (2.0, 0.8, False),
                                                        (0.6, 0.1, False)])  # fmt: skip
def test_an_error_that_clocks_make_is_no_wrong_start(off_m, late_s, is_so):
    bundle = synthetic_bundle(seconds=5)
    t = (at_scans(bundle) - START_NS) / 1e9
    off = true_path(t) + np.array([off_m, 0.0, 0.0])
    belief = PoseTrack.without_covariance("map", "base_link", at_scans(bundle), off)
    hindsight = hindsight_of(bundle)
    error = belief_error(belief, hindsight, LIMITS)
    nothing = np.full(len(t), np.nan)
    delay = Delay(late_s, 0.01, 5, "scans")
    case = Case(bundle.view(), error, hindsight, (), nothing, LIMITS, delay)

    assert case.is_made_by_delay(3) is is_so


@pytest.mark.parametrize(
    ("sigma_m", "kind"), [((0.5, 3.0), "optimization_drift"), ((0.5, 0.2), "overconfidence")]
)
def test_a_covariance_that_only_grows_took_nothing_from_its_scans(sigma_m, kind):
    bundle = synthetic_bundle(seconds=40, with_initial_pose=False)
    t = (at_scans(bundle) - START_NS) / 1e9
    hops = 0.25 * np.floor(np.maximum(t - 6.0, 0.0) / 0.8)
    off = true_path(t) + np.outer(hops, [0.8, 0.6, 0.0])
    cov = np.einsum("n,ij->nij", np.interp(t, [0.0, 40.0], sigma_m) ** 2, np.eye(3))
    belief = PoseTrack("map", "base_link", at_scans(bundle), off, cov)
    mode = judge(bundle.view(), belief, hindsight_of(bundle)).failure_mode

    assert mode.kind == kind, mode.evidence


def test_a_start_just_over_the_limit_is_no_confident_accusation():
    bundle = synthetic_bundle(seconds=30)
    t = (at_scans(bundle) - START_NS) / 1e9
    belief = recorded_belief(bundle.view(), at_scans(bundle))
    off = np.where(t < 6.0, 0.52, 0.1)
    near = PoseTrack(
        "map", "base_link", belief.t_ns, true_path(t) + np.outer(off, [1, 0, 0]), belief.cov
    )
    far = PoseTrack(
        "map",
        "base_link",
        belief.t_ns,
        true_path(t) + np.outer(np.where(t < 20, 2.0, 0.0), [1, 0, 0]),
        belief.cov,
    )
    mild = judge(bundle.view(), near, hindsight_of(bundle)).failure_mode
    grave = judge(bundle.view(), far, hindsight_of(bundle)).failure_mode

    assert mild.confidence < 0.5
    assert "just over the limit" in " ".join(mild.evidence)
    assert grave.kind == "wrong_initial_pose"
    assert grave.confidence == 0.9


def test_the_episode_that_tells_most_names_the_cause():
    bundle = synthetic_bundle(seconds=40)
    t = (at_scans(bundle) - START_NS) / 1e9
    ahead = np.where(t >= 20, t + 5, t)
    belief = dead_reckoned(bundle)
    wobble = np.where(t < 5.0, 0.55, 0.0)
    belief = replace(belief, xyyaw=belief.xyyaw + np.outer(wobble, [1, 0, 0]))
    judgement = judge(bundle.view(), belief, hindsight_of(bundle, xyyaw=true_path(ahead)))

    assert judgement.failure_mode.kind == "kidnapped"


def test_a_change_where_the_belief_left_the_truth_comes_before_a_wrong_match():
    bundle = synthetic_bundle(
        belief_offset_xyyaw=(1.0, 0.5, 0.0), offset_from_s=8.0, with_initial_pose=False
    )
    plain = judged(bundle)
    changed = judged(bundle, hindsight_of(bundle, shares=shares_between(bundle, 5, 15, 0.3)))

    assert plain.failure_mode.kind == "association_error"
    assert changed.failure_mode.kind == "stale_map_use"
    assert any("m² appeared" in line for line in changed.failure_mode.evidence)


def without_odometry(bundle):
    view = bundle.view()
    for name in ("odometry", "transforms"):
        table = bundle.table(name)
        static = table["is_static"] if name == "transforms" else np.zeros(len(table), bool)
        view = view.with_table(table.take(static))
    return view


def test_without_odometry_a_carry_is_seen_and_a_slip_is_not_guessed():
    bundle = synthetic_bundle(seconds=40, with_initial_pose=False)
    t = (at_scans(bundle) - START_NS) / 1e9
    cov = np.tile(np.eye(3) * 1e-4, (len(t), 1, 1))
    kinds = []
    for rate, slow in ((3.0, 0.0), (1.0, 0.5)):  # carried while it stood; its wheels slipped
        real = np.interp(t, [0, 15, 18, 40], [0, 15, 15 + 3 * rate, 37 + 3 * rate - 3])
        held = np.interp(t, [0, 15, 18, 40], [0, 15, 15 + 3 * slow, 37 + 3 * slow - 3])
        belief = PoseTrack("map", "base_link", at_scans(bundle), true_path(held), cov)
        hindsight = hindsight_of(bundle, xyyaw=true_path(real))
        kinds.append(judge(without_odometry(bundle), belief, hindsight).failure_mode.kind)

    assert kinds == ["kidnapped", "none"]


#: What a perturbation does to a log is what the failure mode says was done to it.
REPRODUCED = [
    ("tf_delay.odometry", 0.3, "timing", "odometry"),
    ("scan_delay.stamp", 0.3, "timing", "scans are stamped"),
    ("scan_drop.burst", 6.0, "timing", "no scan came for"),
    ("scan_drop.random", 0.9, "timing", "no scan came for"),
    ("initial_pose.offset", 3.0, "wrong_initial_pose", "first belief"),
    ("initial_pose.rotate", 90.0, "wrong_initial_pose", "first belief"),
    ("odometry_scale.translation", 1.3, "odometry_slip", "odometry"),
    ("odometry_scale.rotation", 1.5, "odometry_slip", "too much turn"),
]


@pytest.mark.parametrize(
    ("name", "level", "kind", "words"), [(None, None, "none", ""), *REPRODUCED]
)
def test_the_failure_mode_is_the_perturbation_that_reproduces_it(drive, name, level, kind, words):
    bundle, truth = drive
    seed, view, late_s = 1, bundle.view(), 0.0
    run = run_trial(bundle, Trial(bundle.manifest.bundle_id, "amcl", seed, name, level))
    if name is not None:
        what, _, variant = name.partition(".")
        stream = np.random.SeedSequence([seed, 1])
        rng = np.random.Generator(np.random.PCG64(stream))
        view = PERTURBATIONS.load(what)().apply(view, variant, level, rng)
        late_s = level if what == "scan_delay" else 0.0
    judgement = judge(view, run.estimate.track, seen_from(view, truth, late_s))

    assert judgement.failure_mode.kind == kind
    assert words in " ".join(judgement.failure_mode.evidence)


def test_a_gap_in_the_recording_alone_is_no_cause(drive):
    bundle, _ = drive
    scans = bundle.table("scans")
    low, high = scans.t_ns[0] + ns(20.0), scans.t_ns[0] + ns(25.0)
    view = bundle.view().with_table(scans.take((scans.t_ns < low) | (scans.t_ns > high)))

    assert scan_gaps(view, low, high + ns(1.0)) == ()
    (gap,) = scan_gaps(view, low, high + ns(1.0), recorded=False)
    assert (gap.end_ns - gap.start_ns) / 1e9 == pytest.approx(5.1, abs=0.11)
    assert gap.moved_m > 1.0


@pytest.mark.parametrize(
    ("sigma_m", "kind"), [(None, "optimization_drift"), (0.02, "overconfidence")]
)
def test_an_error_that_grows_is_drift_or_a_false_trust_in_itself(sigma_m, kind):
    bundle = synthetic_bundle(seconds=60, with_initial_pose=False)
    t = (at_scans(bundle) - START_NS) / 1e9
    path = true_path(t)
    slid = path + np.outer(np.maximum(t - 5.0, 0.0) * 0.025, [0.6, 0.8, 0.0])
    belief = PoseTrack.without_covariance("map", "base_link", at_scans(bundle), slid)
    if sigma_m is not None:
        belief = replace(belief, cov=np.tile(np.eye(3) * sigma_m**2, (len(t), 1, 1)))
    judgement = judge(bundle.view(), belief, hindsight_of(bundle))

    assert (judgement.state, judgement.failure_mode.kind) == ("lost", kind)


@pytest.mark.parametrize(("off_m", "told"), [(0.1, True), (2.0, False)])
def test_a_cloud_that_was_right_is_said_where_the_belief_was_wrong(off_m, told):
    bundle = synthetic_bundle(belief_offset_xyyaw=(2.0, 0.0, 0.0), offset_from_s=0.0)
    t_s = np.arange(0.5, 18.0, 0.5)
    around = np.random.default_rng(0).normal(0.0, 0.05, (len(t_s), 50, 3))
    clouds = true_path(t_s)[:, None, :] + around + np.array([off_m, 0.0, 0.0])
    table = rows(
        "particles",
        t_s,
        frame_id=["map"] * len(t_s),
        xyyaw=[cloud.ravel() for cloud in clouds],
        weights=[np.zeros(0)] * len(t_s),
    )
    view = bundle.view().with_table(table)
    judgement = judge(view, recorded_belief(view, at_scans(bundle)), hindsight_of(bundle))

    assert judgement.state == "lost"
    assert ("its particles were right" in " ".join(judgement.failure_mode.evidence)) == told
    assert (judgement.failure_mode.kind == "none") == told


def test_summaries_are_short_and_do_not_contradict_themselves():
    bundle = synthetic_bundle(belief_offset_xyyaw=(1.0, 0.5, 0.0), offset_from_s=8.0)
    both = judged(bundle, hindsight_of(bundle, shares=shares_between(bundle, 5, 15, 0.3)))
    brief = synthetic_bundle(seconds=60)
    t = (at_scans(brief) - START_NS) / 1e9
    belief = recorded_belief(brief.view(), at_scans(brief))
    jumped = belief.xyyaw + np.outer(np.where((t > 8) & (t < 10), 1.9, 0.0), [1, 0, 0])
    told = judge(brief.view(), replace(belief, xyyaw=jumped), hindsight_of(brief))

    assert len(both.summary) <= MOST_CHARACTERS
    assert told.state == "healthy"
    assert "1.9" not in told.summary


@pytest.mark.parametrize("lost", [False, True])
def test_a_map_of_which_most_is_contradicted_is_weak_evidence(lost):
    offset = (1.0, 0.5, 0.0) if lost else (0.0, 0.0, 0.0)
    bundle = synthetic_bundle(belief_offset_xyyaw=offset, offset_from_s=8.0)
    told = judged(bundle, hindsight_of(bundle, shares=shares_between(bundle, 5, 15, 0.6)))
    less = judged(bundle, hindsight_of(bundle, shares=shares_between(bundle, 5, 15, 0.3)))
    version = bundle.view().grid.version
    held = rows("map_updates", [0.0], map_version=[version], frame_id=["map"])
    view = bundle.view().with_table(held)
    hindsight = hindsight_of(bundle, shares=shares_between(bundle, 5, 15, 0.6))
    own = judge(view, recorded_belief(view, at_scans(bundle)), hindsight)

    assert "weak evidence: 60 % of the beams differ" in told.summary
    assert len(told.summary) <= MOST_CHARACTERS
    assert "weak evidence" not in less.summary
    assert "weak evidence" not in own.summary


def test_a_localizer_that_follows_the_truth_beside_it_has_another_map_frame():
    bundle = synthetic_bundle(seconds=25)
    t = at_scans(bundle)
    odom = odometry_track(bundle.view()).at(t).xyyaw
    truth = true_path((t - START_NS) / 1e9)
    bend = np.column_stack(
        [0.12 * np.sin(np.arange(len(t)) / 40.0), 0 * odom[:, 0], 0 * odom[:, 0]]
    )
    hindsight = hindsight_of(bundle, xyyaw=truth + bend)
    offset = np.array([1.5, -2.0, 0.0])
    follows = PoseTrack.without_covariance("map", "base_link", t, truth + bend + offset)
    start = se2.compose(truth[0] + offset, se2.between(odom[0], odom))
    drifts = PoseTrack.without_covariance("map", "base_link", t, start)
    found = [
        constant_offset(bundle.view(), belief_error(b, hindsight, LIMITS), LIMITS)
        for b in (follows, drifts)
    ]

    assert [None if f is None else f.cause for f in found] == ["map", "map_or_start"]


def test_dead_reckoning_wanders_and_a_localizer_is_pulled_back():
    rng = np.random.default_rng(0)
    way = np.arange(0.0, 40.0, 0.08)
    where = np.column_stack([way, 0 * way, 0 * way])
    steps = rng.normal(0.0, (0.006, 0.006, 0.002), (20, len(way), 3))
    noise = rng.normal(0.0, (0.05, 0.05, 0.02), (20, len(way), 3))
    walks = np.cumsum(steps, axis=1) + 0.2 * noise
    pulled = [is_pulled_back(where, rest - rest.mean(axis=0)) for rest in noise]
    wandered = [is_pulled_back(where, rest - rest.mean(axis=0)) for rest in walks]

    assert np.mean(pulled) == 1.0
    assert np.mean(wandered) <= 0.3
    assert not is_pulled_back(where[:100], noise[0, :100])


def test_without_odometry_a_belief_that_does_not_wander_tells_the_map_frame():
    bundle = synthetic_bundle(seconds=60)
    t = at_scans(bundle)
    bare = without_odometry(bundle)
    truth = true_path((t - START_NS) / 1e9)
    rng = np.random.default_rng(1)
    turn = np.array([1.5, -2.0, 0.05])
    right = se2.compose(turn, truth + rng.normal(0.0, (0.06, 0.06, 0.03), truth.shape))
    walk = np.cumsum(rng.normal(0.0, (0.005, 0.005, 0.0005), truth.shape), axis=0)
    found = []
    for xyyaw in (right, se2.compose(turn, truth + walk - walk.mean(axis=0))):
        belief = PoseTrack.without_covariance("map", "base_link", t, xyyaw)
        error = belief_error(belief, hindsight_of(bundle), LIMITS)
        found.append(constant_offset(bare, error, LIMITS))

    assert [f.cause for f in found] == ["map", "map_or_start"]
    assert found[0].xyyaw == pytest.approx(turn, abs=0.05)


def test_a_belief_that_was_right_at_first_has_no_other_map_frame():
    bundle = synthetic_bundle(seconds=60)
    t = (at_scans(bundle) - START_NS) / 1e9
    belief = recorded_belief(bundle.view(), at_scans(bundle))
    found = []
    for from_s in (-1.0, 4.0):
        later = np.outer(t > from_s, [0.8, 0.0, 0.0])
        moved = replace(belief, xyyaw=belief.xyyaw + later)
        error = belief_error(moved, hindsight_of(bundle), LIMITS)
        found.append(constant_offset(bundle.view(), error, LIMITS))

    assert found[0] is not None
    assert found[1] is None


def test_confidence_is_monotone_and_never_certain():
    raw = np.linspace(0.0, 1.0, 21)
    said = [confidence(np.full(5, p), 1.0) for p in raw]

    assert np.all(np.diff(said) >= 0.0)
    assert max(said) <= 0.99
    assert calibrated(0.85) == pytest.approx(0.97, abs=0.01)
    assert confidence(np.ones(5), 1.0, unspoken=1.0) == pytest.approx(0.5, abs=0.01)
    assert confidence(np.full(3, np.nan), 1.0) is None


# --- the contract ----------------------------------------------------------------------------


def test_each_action_tells_the_belief_it_consumed():
    bundle = synthetic_bundle()
    view = bundle.view().with_table(recovering([4.2, 12.0]))
    belief = recorded_belief(view, at_scans(bundle))
    first, _ = actions(view, belief, LIMITS)

    assert first.belief.frame_id == "map"
    assert first.belief.consumer == "behaviour Spin"
    assert 0.0 <= first.belief.age_s <= 0.5
    assert first.belief.t_ns == first.t_ns - ns(first.belief.age_s)
    assert first.belief.sigma_xyyaw[:2] == pytest.approx([1e-3**0.5] * 2)
    assert "stale" not in " ".join(first.belief.lacks)


def test_a_stale_or_incomplete_belief_is_a_finding():
    bundle = synthetic_bundle()
    table = bundle.table("transforms")
    silent = (table["child_frame"] == "odom") & (table.t_ns > START_NS + ns(6.0))
    view = bundle.view().with_table(table.take(~silent)).with_table(recovering([12.0]))
    belief = recorded_belief(view, at_scans(bundle))
    bare = PoseTrack.without_covariance("map", "base_link", belief.t_ns, belief.xyyaw)
    (action,) = actions(view, bare, LIMITS)
    (finding,) = contract_findings((action,))
    (none,) = actions(view, None, LIMITS)

    assert action.belief.age_s == pytest.approx(6.0, abs=0.7)
    assert {"no covariance"} < set(action.belief.lacks)
    assert (finding.id, finding.severity) == ("SR-ACT-003", "warning")
    assert "stale" in finding.message
    assert none.belief.lacks[0] == "no belief"


def test_recoveries_of_a_robot_that_was_right_are_needless():
    bundle = synthetic_bundle(belief_offset_xyyaw=(1.0, 0.5, 0.0), offset_from_s=8.0)
    view = bundle.view().with_table(recovering([4.0, 12.0]))
    belief = recorded_belief(view, at_scans(bundle))
    judgement = judge(view, belief, hindsight_of(bundle))

    assert [a.needless for a in judgement.actions] == [True, False]
    assert judgement.actions[1].error_m == pytest.approx(np.hypot(1.0, 0.5), abs=0.1)
    assert "SR-ACT-005" in [f.id for f in judgement.findings]


def test_a_false_covariance_lets_actions_pass_that_were_wrong():
    bundle = synthetic_bundle(belief_offset_xyyaw=(-2.5, 0.0, 0.0), offset_from_s=8.0)
    view = bundle.view().with_table(recovering([12.0]))
    belief = recorded_belief(view, at_scans(bundle))
    sure = PoseTrack("map", "base_link", belief.t_ns, belief.xyyaw, belief.cov * 0.01)
    error = belief_error(sure, hindsight_of(bundle), LIMITS)
    done = actions(view, sure, LIMITS, Outcome(error, ()))

    assert [a.allowed for a in done] == [True]
    assert [f.id for f in risky(done)] == ["SR-ACT-004"]


def test_clearance_is_taken_along_the_way():
    bundle = synthetic_bundle()
    view = bundle.view().with_table(recovering([4.0]))
    belief = recorded_belief(view, at_scans(bundle))
    (going,) = actions(view, belief, LIMITS)
    still = standing(bundle, 4.0, 18.0).with_table(recovering([4.0]))
    staying = actions(still, recorded_belief(still, at_scans(bundle)), LIMITS)[0]

    assert going.clearance_m < staying.clearance_m - 0.05


# --- stops -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("message", "is_named"),
    [("protective stop: front field", True), ("Emergency stop released", False)],
)
def test_a_protective_stop_is_named(message, is_named):
    bundle = synthetic_bundle(seconds=30)
    health = rows("health", [9.5], level=[2], name=["safety_plc"], message=[message])
    view = standing(bundle, 10.0, 16.0).with_table(health)
    view = view.with_table(recovering([1.0], "NavigateRecovery"))
    (stop,) = judge(view, None, hindsight_of(bundle)).stops

    assert ("protective stop" in stop.cause) is is_named


def test_an_aborted_goal_is_a_first_cause():
    bundle = synthetic_bundle(seconds=30)
    view = standing(bundle, 10.0, 16.0)
    view = view.with_table(recovering([10.5], "NavigateRecovery", "failure"))
    (stop,) = judge(view, None, hindsight_of(bundle)).stops

    assert "its goal was aborted" in stop.cause


def test_what_was_lacking_is_said():
    judgement = judged(synthetic_bundle())

    assert any(line.startswith("no imu") for line in judgement.lacking)
    assert not any(line.startswith("no map") for line in judgement.lacking)


def test_a_small_area_is_not_told_as_nothing():
    assert [square_metres(area) for area in (0.0199, 0.64, 0.97, 12.34)] == [
        "0.02 m²", "0.64 m²", "1.0 m²", "12.3 m²",
    ]  # fmt: skip
