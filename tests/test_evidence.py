"""What a belief is held against: consistent ones have whitened errors of variance 1."""

from dataclasses import replace

import numpy as np
import pytest
from evidence_logs import (
    CAMERA,
    CYCLE_S,
    DRIVE_S,
    SECOND,
    TAGS,
    battery,
    belief,
    bundle,
    docking,
    fixed,
    fixes,
    moving,
    ns,
    odometry,
    odometry_topic,
    path,
    posed,
    rows,
    sightings,
    surveyed,
)
from scipy.spatial.transform import Rotation

from slamreplay.bundle.batteries import charging_stretches
from slamreplay.bundle.findings import Finding
from slamreplay.bundle.odometry import odometry_track
from slamreplay.bundle.run import Innovations
from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.tables import Table
from slamreplay.bundle.track import PoseTrack
from slamreplay.consistency.answers import Suspicion
from slamreplay.consistency.belief import credible, shape
from slamreplay.consistency.belief.collapse.outgrown import outgrown
from slamreplay.consistency.belief.credibility import check
from slamreplay.consistency.context import CheckContext
from slamreplay.consistency.evidence import gathering
from slamreplay.consistency.evidence.carried import carried
from slamreplay.consistency.evidence.gathering import evidence_of
from slamreplay.consistency.evidence.hindsight_size import HindsightSize
from slamreplay.consistency.evidence.laid_onto import laid_onto
from slamreplay.consistency.evidence.published import published_belief
from slamreplay.consistency.evidence.references import references_of, unused_references
from slamreplay.consistency.evidence.source import Reference
from slamreplay.consistency.evidence.standing_still import against_the_past, things, visits
from slamreplay.consistency.statistics.mean_test import mean_test
from slamreplay.consistency.statistics.whitening import whitened
from slamreplay.geometry import se2
from slamreplay.geometry.covariance import composed, ros_from_planar
from slamreplay.testing.edits import poisoned

#: The map in `earth`, turned in every way, and how the antenna sits on the robot.
T_EARTH_MAP = np.eye(4)
T_EARTH_MAP[:3, :3] = Rotation.from_euler("xyz", [0.4, -0.7, 1.9]).as_matrix()
T_EARTH_MAP[:3, 3] = [3.9e6, 3.0e5, 5.0e6]
ANTENNA = np.array([0.3, -0.2, 0.8])


def earth_over_map():
    quaternion = Rotation.from_matrix(T_EARTH_MAP[:3, :3]).as_quat()
    return rows("transforms", [0.0], "/tf_static", parent_frame="earth", child_frame="map",
                is_static=[True], translation_xyz=T_EARTH_MAP[None, :3, 3],
                rotation_xyzw=quaternion[None])  # fmt: skip


def tagged(rng, told=1.0, size=1.0):
    return [
        belief(rng, told, size=size),
        odometry(hz=5),
        sightings(rng, TAGS, hz=2.0),
        *surveyed(rng),
    ]


def reflectors(rng, told=1.0, size=1.0):
    seen = sightings(rng, TAGS, hz=2.0, heading=False)
    return [belief(rng, told, size=size), odometry(hz=5), seen, *surveyed(rng)]


def unknown(rng, told=1.0, size=1.0):
    return [belief(rng, told, size=size), odometry(hz=5), sightings(rng, TAGS, hz=2.0, kind="dock")]


def at_dock(rng, told=1.0, size=1.0):
    return docking(rng, 40, told, size)


def in_the_open(rng, told=1.0, size=1.0):
    seen = fixes(rng, np.linalg.inv(T_EARTH_MAP))
    return [belief(rng, told, size=size), odometry(hz=5), seen, earth_over_map(),
            fixed("base", "gps", ANTENNA)]  # fmt: skip


def two_odometries(rng, told=1.0, size=1.0):
    return [
        belief(rng, told, size=size),
        odometry(hz=5),
        odometry_topic(rng, "/visual_odometry", hz=5),
    ]


def found_in(tables, seconds=3600):
    view = bundle(tables, seconds=seconds).view()
    return evidence_of(published_belief(view), (), view)


def only(tables):
    (evidence,) = found_in(tables)
    return evidence


#: What makes a log, the source's name and kind, its axes, and how much of the claimed variance a
#: consistent belief shows: all of it, but for what was claimed beside.
SOURCES = [
    (tagged, "surveyed fiducials tag_1, tag_2, tag_3 and 1 more", "fiducial", 3, (0.96, 1.04)),
    (reflectors, "surveyed fiducials tag_1, tag_2, tag_3 and 1 more", "fiducial", 2, (0.96, 1.04)),
    (unknown, "docks seen again, tag_1, tag_2, tag_3 and 1 more", "dock", 2, (0.94, 1.06)),
    (at_dock, "charging edges", "dock", 3, (0.92, 1.04)),
    (in_the_open, "gnss /fix", "gnss", 2, (0.86, 1.02)),
    (two_odometries, "second odometry /visual_odometry", "second_odometry", 3, (0.3, 1.0)),
]


@pytest.mark.parametrize(("make", "source", "kind", "axes", "variance"), SOURCES)
def test_a_consistent_belief_has_errors_of_the_size_it_claims(make, source, kind, axes, variance):
    squares, p_small = [], []
    for seed in range(100 if make is not two_odometries else 30):
        evidence = only(make(np.random.default_rng(seed)))
        assert (evidence.source, evidence.kind, len(evidence.axes)) == (source, kind, axes)
        assert evidence.at_most
        assert (np.diff(evidence.t_ns) >= 0).all()
        white = whitened(evidence.error, evidence.cov)
        squares.append(white.ravel() ** 2)
        p_small.append(mean_test(white).p_small)

    assert variance[0] <= np.concatenate(squares).mean() <= variance[1]
    assert np.mean(np.array(p_small) < 0.05) <= 0.09  # 5 % expected, 9 of 100 come once in 30
    assert np.sum(np.array(p_small) < 1e-3) <= 1


@pytest.mark.parametrize(("make", "size"), [
    (tagged, 1.0), (reflectors, 1.0), (at_dock, 1.0), (in_the_open, 1.0), (unknown, 3.0),
    (two_odometries, 5.0),
])  # fmt: skip
def test_a_belief_that_claims_half_its_sigma_is_found(make, size):
    # What a single sighting, or an odometry over seconds, has wrong itself hides smaller errors.
    for seed in range(5):
        evidence = only(make(np.random.default_rng(seed), 0.5, size))
        assert mean_test(whitened(evidence.error, evidence.cov)).p_small < 1e-3


# --- carrying a belief to what was sensed ------------------------------------------------------


def test_a_carried_belief_errs_as_is_claimed_for_it():
    """By Monte Carlo at a generic pose: the heading's error swings the thing, odometry slips."""
    rng = np.random.default_rng(2)
    draws = 20_000
    P = np.array([[4e-4, 1e-4, 5e-5], [1e-4, 9e-4, -8e-5], [5e-5, -8e-5, 3e-4]])
    R = np.array([[3e-4, -1e-4, 2e-5], [-1e-4, 2e-4, 4e-5], [2e-5, 4e-5, 5e-4]])
    pose, step = np.array([2.0, -1.0, 0.8]), np.array([0.3, 0.1, 0.4])
    thing = np.array([1.7, -0.9, 1.1])  # in the base at the end of the step
    slip = np.array([np.hypot(0.3, 0.1), np.hypot(0.3, 0.1), 0.4]) * 0.05
    motion = PoseTrack.without_covariance(
        "odom", "base", ns([0.0, 1.0]), np.array([[0.0, 0.0, 0.0], step])
    )
    update = PoseTrack("map", "base", ns([0.0]), pose[None], P[None])
    one = np.array(["thing"], dtype=object)

    got = carried(update, motion, ns([1.0]), one, thing[None], R[None], 1.0)

    samples = se2.compose(
        pose + rng.multivariate_normal(np.zeros(3), P, draws),
        se2.compose(
            step + slip * rng.standard_normal((draws, 3)),
            thing + rng.multivariate_normal(np.zeros(3), R, draws),
        ),
    )
    expected = se2.compose(pose, se2.compose(step, thing))
    np.testing.assert_allclose(got.places[0], expected, atol=1e-12)
    covariance = np.cov((samples - expected).T)
    np.testing.assert_allclose(got.cov[0], covariance, atol=0.03 * covariance.max())


def test_an_update_counts_once_for_each_thing_and_is_not_carried_far_nor_beyond_odometry():
    t_s = np.array([0.0, 1.0, 2.0, 9.0])
    updates = PoseTrack("map", "base", ns(t_s), np.zeros((4, 3)), np.tile(np.eye(3), (4, 1, 1)))
    motion = PoseTrack.without_covariance(
        "odom", "base", ns(np.arange(0.0, 9.01, 0.1)), np.zeros((91, 3))
    )
    seen_s = np.array([0.1, 0.2, 0.3, 0.9, 1.45, 4.0, 9.1])
    name = np.array(["a", "a", "b", "a", "a", "a", "a"], dtype=object)

    at = carried(updates, motion, ns(seen_s), name, np.zeros((7, 3)), np.zeros((7, 3, 3)), 0.5)

    # 0.2 is behind 0.1; 1.45 behind 0.9; 4.0 is too far from any update; 9.1 after the odometry.
    assert list(zip(at.update.tolist(), at.sensed.tolist(), strict=True)) == [
        (0, 0), (0, 2), (1, 3),
    ]  # fmt: skip
    alone = carried(
        updates, None, ns(np.array([1.0, 1.1])), name[:2], np.zeros((2, 3)),
        np.zeros((2, 3, 3)), 0.5,
    )  # fmt: skip
    assert alone.sensed.tolist() == [0]


# --- things that stand still ---------------------------------------------------------------------


@pytest.mark.parametrize("known", [True, False])
def test_rows_against_the_past_are_the_joint_distribution_row_by_row(known):
    """Their squares sum to Mahalanobis' distance of all places at once, whose survey is shared."""
    rng = np.random.default_rng(4)
    n, m = 7, 3
    root = rng.normal(size=(n, m, m))
    cov = root @ np.swapaxes(root, 1, 2) + 0.1 * np.eye(m)
    places = rng.normal(size=(n, m))
    prior = np.diag([0.3, 0.5, 0.2])

    error, claimed = against_the_past(places, cov, prior if known else None)

    whole = np.kron(np.ones((n, n)), prior if known else 1e9 * np.eye(m))
    for i in range(n):
        whole[m * i : m * i + m, m * i : m * i + m] += cov[i]
    expected = places.ravel() @ np.linalg.solve(whole, places.ravel())
    assert len(error) == n - (not known)
    assert (whitened(error, claimed) ** 2).sum() == pytest.approx(expected, rel=1e-5)


def test_one_survey_that_is_off_is_one_error_however_often_it_is_seen():
    rng = np.random.default_rng(5)
    places = np.array([0.12, -0.1]) + 0.01 * rng.standard_normal((300, 2))
    cov = np.tile(1e-4 * np.eye(2), (300, 1, 1))
    error, claimed = against_the_past(places, cov, np.diag([0.03, 0.03]) ** 2)

    squares = (whitened(error, claimed) ** 2).sum(axis=1)
    assert squares[0] > 15.0
    assert squares[1:].mean() < 2.5


def test_visits_are_apart_and_things_are_told_apart_by_place_and_heading():
    assert visits(ns(np.array([0.0, 3.0, 9.9, 10.0, 25.0, 30.0]))).tolist() == [0, 3, 4]
    places = np.array([[0.0, 0.0, 3.1], [5.0, 0.0, 0.0], [0.3, 0.1, -3.1], [0.2, 0.0, 0.5],
                       [5.2, 0.1, np.nan]])  # fmt: skip
    assert things(places, 1.5, 0.8).tolist() == [0, 1, 0, 2, 1]


def test_a_constant_offset_shows_against_a_survey_and_never_between_visits():
    def shifted(rng, seen):
        at = lambda t: path(t) + np.array([0.5, -0.3, 0.0])  # noqa: E731
        return [belief(rng, at=at), odometry(hz=5), sightings(rng, TAGS, hz=2.0), *seen]

    rng = np.random.default_rng(6)
    again, absolute = only(shifted(rng, [])), only(shifted(rng, surveyed(rng)))

    assert "seen again" in again.source
    assert mean_test(whitened(again.error, again.cov)).p_small > 0.05
    # One row of each tag has it: the rest know then where the tag seems to be.
    assert (whitened(absolute.error, absolute.cov) ** 2).sum(axis=1)[:4].mean() > 12.0


def test_two_things_of_one_name_are_not_taken_for_one():
    rng = np.random.default_rng(7)
    parts = [sightings(rng, {"tag_9": TAGS[name]}, phase=phase)
             for name, phase in (("tag_1", 0.05), ("tag_2", 0.1))]  # fmt: skip
    two = Table.concat(TABLES["references"], parts).sorted_by_time()
    evidence = only([belief(rng), odometry(hz=5), two])

    assert mean_test(whitened(evidence.error, evidence.cov)).p_small > 1e-3


def test_a_belief_that_was_computed_from_the_sightings_is_made_of_them():
    rng = np.random.default_rng(8)
    seen = sightings(rng, {"tag_1": TAGS["tag_1"]}, far=9.0)
    t_s = seen.t_ns / SECOND
    survey = fixed("map", "tag_1", TAGS["tag_1"])
    yaw = 2.0 * np.arctan2(*seen["orientation_xyzw"][:, 2:].T)
    in_camera = np.column_stack([seen["position_xyz"][:, :2], yaw])
    localized = se2.compose(TAGS["tag_1"], se2.inverse(se2.compose(CAMERA, in_camera)))
    # A mirror image of its errors: were it held against the sightings, it would be perfect.
    tables = [belief(rng, t_s=t_s).replace(**posed(localized)), odometry(hz=5), seen, survey]

    (evidence,) = found_in(tables)
    (finding,) = check(context_of(tables))

    assert evidence.refusal
    assert (finding.id, finding.severity) == ("SR-CON-003", "info")
    assert "sightings of fiducials: its updates bear their very stamps and" in finding.message
    # Another localizer may well keep the same time.
    assert not only([belief(rng, t_s=t_s), *tables[1:]]).refusal


def test_a_sighting_that_comes_by_the_localizers_own_correction_is_none():
    rng = np.random.default_rng(9)
    corrections = moving("map", "odom", np.arange(0.0, 300.0, 1.0),
                         np.tile([0.3, -0.2, 0.1], (300, 1)))  # fmt: skip
    seen = sightings(rng, TAGS, hz=2.0)
    seen = seen.replace(frame_id=np.full(len(seen), "map", dtype=object))

    assert found_in([belief(rng), odometry(hz=5), corrections, seen]) == ()


# --- charging ------------------------------------------------------------------------------------


def test_charging_begins_where_it_had_not_been_told_before():
    told = battery(
        [0.0, 5.0, 20.0, 30.0, 31.0, 50.0],
        ["charging", "discharging", "charging", "full", "charging", "unknown"],
    )
    log = rows("health", [3.0], "/rosout", level=20, name="charging", message="charging")

    assert charging_stretches(bundle([told, log]).view()).tolist() == ns([[20.0, 30.0]]).tolist()


def dockings(states_s, states, *, dockings_=10, seed=10):
    """Rows of charging evidence of a robot that docked ten times."""
    rng = np.random.default_rng(seed)
    seconds = int(dockings_ * CYCLE_S)
    table = docking(rng, dockings_)
    return found_in([*table[:-1], battery(states_s, states)], seconds)


def test_charging_while_it_drives_or_over_again_in_the_dock_is_no_docking():
    start = np.arange(10) * CYCLE_S
    docked = np.sort(np.concatenate([[0.0], start + 1.0, start + DRIVE_S + 0.5]))
    states = ["charging", *["discharging", "charging"] * 10]
    (evidence,) = dockings(docked, states)
    assert len(evidence.error) == 9

    driving = np.sort(np.concatenate([[0.0], start + 2.0, start + 14.0]))
    assert dockings(driving, states[:1] + ["charging", "discharging"] * 10) == ()

    # Its current falls under the limit for a second, in every dock.
    restless = np.sort(np.concatenate([docked, start + DRIVE_S + 2.0, start + DRIVE_S + 3.0]))
    again = ["charging", *["discharging", "charging", "not charging", "charging"] * 10]
    (same,) = dockings(restless, again)
    assert len(same.error) == 9


def test_a_moment_of_current_or_a_robot_that_never_left_is_no_docking():
    start = np.arange(10) * CYCLE_S
    brief = np.sort(np.concatenate([[0.0], start + DRIVE_S + 3.0, start + DRIVE_S + 6.0]))
    assert dockings(brief, ["not charging", *["charging", "not charging"] * 10]) == ()

    rng = np.random.default_rng(26)
    at_rest = lambda t_s: np.tile([1.4, -0.6, 0.9], (len(t_s), 1))  # noqa: E731
    on_off = battery(np.arange(0.0, 280.0, 15.0), ["not charging", *["charging", "full"] * 9])
    switched = on_off.replace(message=np.where(
        on_off["message"] == "full", "not charging", on_off["message"].astype(str)
    ).astype(object))  # fmt: skip
    tables = [belief(rng, at=at_rest), odometry(at_rest, hz=5), switched]
    assert found_in(tables, 300) == ()


def test_a_belief_that_jumps_between_dockings_is_found_and_another_dock_is_another():
    def tables(jump, seed=11):
        rng = np.random.default_rng(seed)
        whole = docking(rng, 40)
        xy = whole[0]["position_xyz"].copy()
        late = whole[0].t_ns > 15 * CYCLE_S * SECOND
        xy[late, 0] += jump
        return [whole[0].replace(position_xyz=xy), *whole[1:]]

    bold = only(tables(1.0))
    assert mean_test(whitened(bold.error, bold.cov)).ratio > 1.2
    apart = only(tables(3.0))
    assert len(apart.error) == 38  # two docks, one row less each
    assert mean_test(whitened(apart.error, apart.cov)).p_small > 1e-3


# --- satellites ----------------------------------------------------------------------------------


def test_fixes_in_earth_are_tied_by_static_transforms_alone_and_told_once_where_not():
    rng = np.random.default_rng(12)
    T = np.linalg.inv(T_EARTH_MAP)
    tables = [belief(rng, size=0.01), odometry(hz=5),
              fixes(rng, T, sigma=1e-4), fixed("base", "gps", ANTENNA)]  # fmt: skip
    log = bundle(tables)
    (unused,) = unused_references(log)
    assert "gnss reference /fix was not held against the belief" in unused.message
    assert "'earth', and no static transform" in unused.message
    assert found_in(tables) == ()

    tied = [*tables, earth_over_map()]
    # Millimetres at six thousand kilometres: the belief and the fixes are that good here.
    assert np.abs(only(tied).error).max() < 0.02
    assert unused_references(bundle(tied)) == ()
    assert references_of(bundle(tied), None) == ()


def test_fixes_of_an_antenna_in_the_bases_origin_are_a_reference_of_its_position():
    rng = np.random.default_rng(13)
    seen = fixes(rng, np.linalg.inv(T_EARTH_MAP), antenna=(0.0, 0.0), sigma=1e-4)
    seen = seen.replace(child_frame_id=np.full(len(seen), "base", dtype=object))
    log = bundle([belief(rng), odometry(hz=5), seen, earth_over_map()])

    (reference,) = references_of(log, None)

    at = path(reference.track.t_ns / SECOND)
    np.testing.assert_allclose(reference.track.xyyaw[:, :2], at[:, :2], atol=1e-3)
    np.testing.assert_allclose(reference.track.cov[:, 0, 0], 1e-8, rtol=1e-6)
    view = log.view()
    (evidence,) = evidence_of(published_belief(view), (reference,), view)
    assert evidence.source == "gnss /fix"  # once, and as fixes that err together


# --- a second odometry -------------------------------------------------------------------------


def test_an_odometry_that_repeats_the_first_is_none():
    rng = np.random.default_rng(14)
    same = odometry_topic(rng, "/odom", slip=0.0, hz=10)

    assert found_in([belief(rng), odometry(), same]) == ()


def test_an_odometry_of_another_frame_of_the_robot_needs_its_mount_and_a_level_world():
    rng = np.random.default_rng(24)
    mount = np.array([0.4, -0.2, 0.9])
    at_base = odometry_topic(rng, "/visual_odometry", slip=0.05)
    yaw = 2.0 * np.arctan2(*at_base["orientation_xyzw"][:, 2:].T)
    base = np.column_stack([at_base["position_xyz"][:, :2], yaw])
    camera = at_base.replace(
        child_frame_id=np.full(len(at_base), "vio", dtype=object), **posed(se2.compose(base, mount))
    )
    others = [belief(np.random.default_rng(24)), odometry()]

    assert found_in([*others, camera]) == ()
    tied, plain = only([*others, camera, fixed("base", "vio", mount)]), only([*others, at_base])
    np.testing.assert_allclose(tied.error, plain.error, atol=1e-6)
    ahead_is_z = at_base.replace(position_xyz=at_base["position_xyz"][:, [1, 2, 0]])
    assert found_in([*others, ahead_is_z]) == ()


def test_a_covariance_of_an_odometry_that_grows_is_what_it_adds_over_a_window():
    rng = np.random.default_rng(15)
    plain = odometry_topic(rng, "/visual_odometry", slip=0.1, hz=2)
    yaw = 2.0 * np.arctan2(*plain["orientation_xyzw"][:, 2:].T)
    xyyaw = np.column_stack([plain["position_xyz"][:, :2], yaw])
    cov = np.zeros((len(plain), 3, 3))
    cov[0] = 1e-6 * np.eye(3)
    for i, step in enumerate(se2.between(xyyaw[:-1], xyyaw[1:])):
        cov[i + 1] = composed(xyyaw[i], cov[i], step, np.diag([4e-4, 1e-4, 1e-5]))
    told = plain.replace(pose_covariance=ros_from_planar(cov))

    with_own, without = (only([belief(np.random.default_rng(15), size=0.01), odometry(), topic])
                         for topic in (told, plain))  # fmt: skip

    steps = with_own.cov[:, 2, 2] / 1e-5
    assert 10.0 <= steps.min() <= steps.max() <= 16.0  # of half a second, in windows of 5 to 7 s
    spread = np.trace(with_own.cov[:, :2, :2], axis1=1, axis2=2)
    assert (spread > 10 * 5e-4).all()
    assert spread.max() < 16 * 5e-4 + 0.03
    assert without.cov[:, 2, 2].min() > 4e-4


# --- what the check makes of it ------------------------------------------------------------------


def context_of(tables, references=(), seconds=3600, innovations=()):
    view = bundle(tables, seconds=seconds).view()
    return CheckContext(
        published_belief(view), tuple(references), view, innovations=tuple(innovations)
    )


def truth(kind, offset=0.0):
    t_s = np.arange(0.0, 300.0, 0.1)
    xyyaw = path(t_s) + offset
    return Reference(kind, kind, PoseTrack.without_covariance("map", "base", ns(t_s), xyyaw))


def test_every_independent_source_is_asked_and_named():
    rng = np.random.default_rng(16)
    docks = sightings(rng, {"dock": TAGS["tag_2"]}, hz=2.0, kind="dock", phase=0.03)
    tables = [*tagged(rng, told=0.5), docks]
    answers = check(context_of(tables, [truth("motion_capture"), truth("hindsight")]))

    told = [(a.finding.id, a.finding.message.split("against ")[-1].split(";")[0]) for a in answers]
    assert (
        told
        == [
            ("SR-CON-001", "motion capture"),
            ("SR-CON-001", "surveyed fiducials tag_1, tag_2, tag_3 and 1 more"),
            ("SR-CON-001", "docks seen again, dock"),
        ][: len(told)]
    )
    assert len(told) >= 2
    assert all(a.p_value < 1e-3 for a in answers[:2])
    assert "by a factor of 2" in answers[0].finding.message
    assert "by a factor of at least 1." in answers[1].finding.message


def test_shared_evidence_is_asked_only_where_nothing_else_tells():
    rng = np.random.default_rng(17)
    tables = tagged(rng, told=0.2)
    answers = check(context_of(tables, [truth("hindsight")]))

    by = {a.finding.message.split("against ")[1].split(" (")[0].split(";")[0]: a for a in answers}
    assert set(by) == {"surveyed fiducials tag_1, tag_2, tag_3 and 1 more", "hindsight"}
    assert all(a.p_value < 1e-3 for a in by.values())
    assert "hindsight's sigma was inflated by 1." in by["hindsight"].finding.message


def test_hindsights_covariance_is_made_as_large_as_it_ought_to_be(monkeypatch):
    rng = np.random.default_rng(23)
    xyyaw, t_s = path(np.arange(0.0, 300.0, 0.1)), np.arange(0.0, 300.0, 0.1)
    own = np.diag([4e-4, 9e-4, 1e-4]) + 5e-5
    track = PoseTrack("map", "base", ns(t_s), xyyaw, np.tile(own, (len(t_s), 1, 1)))
    hindsight = Reference("hindsight", "hindsight", track)
    tables = [belief(rng), odometry(hz=5)]

    def evidence(size):
        monkeypatch.setattr(gathering, "measured_hindsight_size", lambda: size)
        view = bundle(tables).view()
        (found,) = evidence_of(published_belief(view), (hindsight,), view)
        return found

    small, large = (
        evidence(HindsightSize(50, 0, "train", 0.8, 0.5, 0.7, 0.5, 0.9, 0.8)),
        evidence(HindsightSize(50, 0, "train", 1.1, 0.9, 1.0, 0.8, 1.5, 2.0)),
    )

    by = np.array([1.5, 1.5, 2.0])
    grown = own * by[:, None] * by - own
    np.testing.assert_allclose(large.cov - small.cov, np.tile(grown, (len(large.cov), 1, 1)))
    assert (
        small.note
        == "hindsight's sigma was taken as it is: 95 % of 50 simulated logs erred by no more"
    )
    assert "was inflated by 1.5 in position and by 2 in heading, its calibrated size" in large.note
    assert small.shared
    assert small.at_most


def test_shared_evidence_must_be_gross():
    tables = [belief(np.random.default_rng(27), told=0.7), odometry(hz=5)]

    (against,) = context_of(tables, [truth("hindsight")]).evidence
    answers = check(context_of(tables, [truth("hindsight")]))

    assert mean_test(whitened(against.error, against.cov)).p_small < 1e-3
    assert [a.p_value for a in answers if isinstance(a, Suspicion)] == [1.0]
    assert any("no gross over-confidence" in a.message for a in answers if isinstance(a, Finding))


def test_a_bound_has_no_shape_that_could_be_off():
    rng = np.random.default_rng(28)
    bounded = context_of(tagged(rng, told=0.3))
    for ask_shape in (shape.check, credible.check):
        assert ask_shape(bounded) == ()
        assert ask_shape(replace(bounded, references=(truth("simulation"),)))


def test_a_bound_does_not_silence_hindsight_where_a_belief_left_what_it_allows():
    rng = np.random.default_rng(29)
    tables = unknown(rng)
    away = (tables[0].t_ns > 100 * SECOND) & (tables[0].t_ns < 140 * SECOND)
    shifted = tables[0]["position_xyz"] + away[:, None] * np.array([1.4, -1.1, 0.0])
    unseen = (tables[2].t_ns < 90 * SECOND) | (tables[2].t_ns > 150 * SECOND)
    tables = [tables[0].replace(position_xyz=shifted), tables[1], tables[2].take(unseen)]
    context = context_of(tables, [truth("hindsight")])

    (stretch,), _ = outgrown(context.updates, context.evidence)

    assert not stretch.independent
    assert abs(stretch.start_ns - 100 * SECOND) < 5 * SECOND
    assert abs(stretch.end_ns - 140 * SECOND) < 5 * SECOND


def test_a_bound_never_calls_a_belief_timid_nor_right():
    rng = np.random.default_rng(18)
    for told in (1.0, 4.0):
        *suspicions, finding = reversed(check(context_of(tagged(rng, told=told))))
        assert finding.id == "SR-CON-003"
        assert "surveyed fiducials" in finding.message
        assert "cannot prove consistency" in finding.message
        assert "too large" not in finding.message
        assert all(s.p_value > 1e-3 for s in suspicions)


def test_what_an_estimator_is_made_of_says_nothing_of_it():
    rng = np.random.default_rng(19)
    tables = tagged(rng, told=0.2)
    used = Innovations("fiducial with heading", ns([1.0]), np.zeros((1, 3)), np.eye(3)[None],
                       np.ones(1, dtype=bool))  # fmt: skip

    assert context_of(tables).evidence
    assert context_of(tables, innovations=[used]).evidence == ()


def test_updates_that_are_left_out_are_held_against_nothing():
    rng = np.random.default_rng(25)
    view = bundle([*tagged(rng), odometry_topic(rng, "/visual_odometry", hz=5)]).view()
    updates = published_belief(view)
    late = updates.t_ns > 150 * SECOND

    found = evidence_of(updates, (truth("simulation"),), view, left_out=late)

    assert [e.kind for e in found] == ["simulation", "fiducial", "second_odometry"]
    for e in found:
        told = np.isfinite(whitened(e.error, e.cov)).all(axis=1)
        assert e.t_ns[told].max() <= 150 * SECOND
    nothing = evidence_of(updates, (truth("simulation"),), view, left_out=np.ones_like(late))
    assert [e.kind for e in nothing] == ["simulation"]


def test_references_that_only_judge_change_nothing_of_what_was_sensed():
    rng = np.random.default_rng(20)
    t_s = np.arange(0.0, 300.0, 0.1)
    judging = rows("references", t_s, "/truth", frame_id="map", child_frame_id="base",
                   kind="simulation", covariance=np.full((len(t_s), 36), np.nan),
                   position_xyz=np.column_stack([path(t_s)[:, :2], np.zeros(len(t_s))]),
                   orientation_xyzw=np.tile([0.0, 0.0, 0.0, 1.0], (len(t_s), 1)))  # fmt: skip
    log = bundle([*tagged(rng), judging])
    one, two = (evidence_of(published_belief(b.view()), references_of(b, None), b.view())
                for b in (log, poisoned(log)))  # fmt: skip

    assert [e.kind for e in one] == ["simulation", "fiducial"]
    np.testing.assert_array_equal(one[1].error, two[1].error)
    assert np.abs(two[0].error[:, 0]).min() > 90.0


def test_what_was_held_out_of_hindsight_judges_the_belief():
    rng = np.random.default_rng(21)
    log = bundle(tagged(rng))
    held = log.view(["fiducial"])

    assert [e.kind for e in evidence_of(published_belief(held), (), held)] == ["fiducial"]
    assert odometry_track(held) is not None


# --- a reference in a frame of its own --------------------------------------------------------


def test_a_reference_that_is_laid_onto_the_belief_leaves_errors_of_their_size():
    """Over many short logs: what the alignment eats is taken out of the covariance, too."""
    squares = []
    for seed in range(150):
        rng = np.random.default_rng(seed)
        updates = published_belief(bundle([belief(rng, t_s=np.arange(1.0, 9.0))]).view())
        t_s = np.arange(0.0, 10.0, 0.1)
        own = se2.compose(np.array([4.0, -3.0, 2.2]), path(t_s))
        lab = PoseTrack.without_covariance("lab", "base", ns(t_s), own)
        evidence = laid_onto(updates, lab, "/mocap", "motion_capture")
        squares.append((whitened(evidence.error, evidence.cov) ** 2).mean())

    assert np.mean(squares) == pytest.approx(1.0, abs=0.06)  # 0.875 if it were not counted


def test_a_reference_in_a_frame_of_its_own_is_shown_and_judges_nothing():
    rng = np.random.default_rng(22)
    t_s = np.arange(0.0, 300.0, 0.1)
    own = se2.compose(np.array([4.0, -3.0, 2.2]), path(t_s))
    mocap = rows("references", t_s, "/mocap", frame_id="lab", child_frame_id="base",
                 kind="motion_capture", covariance=np.full((len(t_s), 36), np.nan),
                 **posed(own))  # fmt: skip
    log = bundle([belief(rng, told=0.5), odometry(hz=5), mocap])
    updates = published_belief(log.view())

    (finding,) = unused_references(log, updates)

    assert (finding.id, finding.severity) == ("SR-CON-003", "info")
    assert "no static transform" in finding.message
    assert "no judgement), the sigma of the pose is too small by a factor of 2" in finding.message
    assert references_of(log, None) == ()
    assert "Aligned" not in unused_references(log)[0].message
