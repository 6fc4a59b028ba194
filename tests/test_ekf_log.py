"""The extended Kalman filter over a whole log."""

import numpy as np
import pytest

from slamreplay.bundle.run import Run, Trial, read_run, run_bytes
from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.tables import Table
from slamreplay.errors import NotApplicableError
from slamreplay.estimators.dead_reckoning import DeadReckoning
from slamreplay.estimators.ekf.estimator import MEASUREMENT_NOISE, PROCESS_NOISE, Ekf, EkfTuned
from slamreplay.estimators.ekf.noise import Noise
from slamreplay.estimators.start import GLOBAL
from slamreplay.geometry import se2
from slamreplay.testing import edits
from slamreplay.testing.estimators import estimate_bytes
from slamreplay.testing.synthetic import START_NS, synthetic_bundle, true_path
from slamreplay.testing.synthetic_rows import table_of, tf_rows

TAGGED = synthetic_bundle(seconds=20.0, with_tags=True)
NOBODY_SAID = synthetic_bundle(
    seconds=20.0, with_tags=True, with_belief=True, with_initial_pose=False
)


def error(track) -> np.ndarray:
    return se2.between(true_path((track.t_ns - START_NS) / 1e9), track.xyyaw)


def test_it_follows_the_robot_from_a_wrong_start():
    estimate = Ekf().run(TAGGED.view(), seed=1)
    off = error(estimate.track)

    assert np.hypot(*off[0, :2]) > 0.1
    assert np.hypot(*off[50:, :2].T).max() < 0.1
    assert np.abs(off[50:, 2]).max() < 0.05
    assert estimate.track.frame_id == "map"
    assert 0.2 < estimate.diagnostics["updated"].mean() < 0.8


def test_points_and_tags_with_headings_are_sets_of_their_own():
    sets = {i.source: i for i in Ekf().run(TAGGED.view(), seed=1).innovations}

    assert list(sets) == ["fiducial", "fiducial with heading"]
    assert sets["fiducial"].axes == ("range m", "bearing rad")
    assert sets["fiducial with heading"].axes == ("range m", "bearing rad", "heading rad")
    for one in sets.values():
        m = len(one.axes)
        assert one.residual.shape == (len(one.t_ns), m)
        assert one.S.shape == (len(one.t_ns), m, m)
        assert (np.diff(one.t_ns) >= 0).all()
        assert one.accepted.mean() > 0.95


def test_without_any_start_it_places_itself():
    view = TAGGED.view().with_setting(GLOBAL, 1.0)
    estimate = Ekf().run(view, seed=1)
    track = estimate.track

    first = int(np.argmax(track.has_pose))
    assert first > 0
    assert not np.isfinite(track.cov[:first]).any()
    assert track.has_pose[first:].all()
    assert estimate.diagnostics["updated"][first] == 1
    assert np.hypot(*error(track)[first:, :2].T).max() < 0.15
    assert estimate.scalars["located_by_sightings"] == 1
    assert estimate.scalars["sightings_before_start"] >= 3


def test_things_without_a_survey_are_counted_and_not_used():
    transforms = TAGGED.table("transforms")
    known = TAGGED.view().with_table(transforms.take(transforms["child_frame"] != "tag_1"))
    seen = (TAGGED.table("references")["child_frame_id"] == "tag_1").sum()

    scalars = Ekf().run(known, seed=1).scalars
    assert scalars["sightings_without_survey"] == seen > 0
    none = transforms.take(~np.char.startswith(transforms["child_frame"].astype(str), "tag"))
    unknown = TAGGED.view().with_table(none)
    assert Ekf().run(unknown, seed=1).scalars["sightings_without_survey"] > seen
    for view, estimator in ((unknown, EkfTuned()), (unknown.with_setting(GLOBAL, 1.0), Ekf())):
        with pytest.raises(NotApplicableError, match="survey"):
            estimator.run(view, seed=1)


def test_without_sightings_it_carries_odometry_on():
    """In the map from a pose in it, in the odometry's own frame from zero; tuning has no ground."""
    blind = edits.without(TAGGED, "sightings")
    startless = synthetic_bundle(seconds=20.0, with_belief=False, with_initial_pose=False)
    for view in (blind.view(), startless.view()):
        found, plain = Ekf().run(view, seed=0).track, DeadReckoning().run(view, seed=0).track
        assert found.frame_id == plain.frame_id
        assert np.abs(np.trace(found.cov - plain.cov, axis1=1, axis2=2)).max() < 0.01
        origin = se2.compose(plain.xyyaw[0], se2.inverse(found.xyyaw[0]))
        np.testing.assert_allclose(se2.compose(origin, found.xyyaw), plain.xyyaw, atol=1e-9)
    with pytest.raises(NotApplicableError, match="sightings"):
        EkfTuned().run(blind.view(), seed=0)
    with pytest.raises(NotApplicableError, match="sightings"):
        Ekf().run(blind.view().with_setting(GLOBAL, 1.0), seed=0)


def test_the_ledger_tells_what_was_seen_and_how_far_it_moved_the_belief():
    for one in Ekf().run(TAGGED.view(), seed=1).innovations:
        assert one.frame_id == "base_link"
        assert set(one.about) <= {f"fiducial tag_{k}" for k in range(6)}
        assert np.isfinite(one.moved).all()
        assert (one.moved[~one.accepted] == 0.0).all()
        assert (np.abs(one.moved[one.accepted]).max(axis=1) > 0.0).all()
    first = min(Ekf().run(TAGGED.view(), seed=1).innovations, key=lambda i: i.t_ns[0])
    assert np.hypot(*first.moved[0, :2]) > 0.02  # off by 0.14 m at the start


def test_wrong_barcodes_are_rejected_and_kept():
    references = TAGGED.table("references")
    names = references["child_frame_id"].copy()
    wrong = np.flatnonzero(names == "tag_0")[3::7]
    names[wrong] = "tag_3"
    view = TAGGED.view().with_table(references.replace(child_frame_id=names))
    estimate = Ekf().run(view, seed=1)

    sets = [i for i in estimate.innovations if i.source == "fiducial with heading"]
    misread = np.isin(sets[0].t_ns, references.t_ns[wrong])
    assert (~sets[0].accepted).sum() >= len(wrong) > 3
    assert not (~sets[0].accepted[~misread]).sum() > 2
    assert np.hypot(*error(estimate.track)[50:, :2].T).max() < 0.1


def test_a_robot_that_was_carried_away_finds_itself_again():
    """Odometry is rewritten so that the robot jumps: its own sightings tell it from then on."""
    carried = synthetic_bundle(seconds=40.0, with_tags=True)
    transforms = carried.table("transforms")
    late = (transforms["child_frame"] == "base_link") & (transforms.t_ns > START_NS + 10 * 10**9)
    position = transforms["translation_xyz"].copy()
    position[late, :2] += (4.0, 3.0)
    view = carried.view().with_table(transforms.replace(translation_xyz=position))
    estimate = Ekf().run(view, seed=1)

    assert estimate.scalars["recoveries"] == 1
    assert np.hypot(*error(estimate.track)[150, :2]) > 1.0
    assert np.hypot(*error(estimate.track)[250:, :2].T).max() < 0.15


def test_told_half_the_noise_it_is_twice_as_sure():
    half = TAGGED.view().with_setting(PROCESS_NOISE, 0.25).with_setting(MEASUREMENT_NOISE, 0.25)
    half = half.with_table(Table.empty(TABLES["initial_poses"])).with_setting(GLOBAL, 1.0)
    whole = TAGGED.view().with_setting(GLOBAL, 1.0)

    sure, plain = (Ekf().run(v, seed=1).track.cov[-1] for v in (half, whole))
    np.testing.assert_allclose(sure, plain / 4.0, rtol=0.01)


def test_the_same_bits_twice_and_with_a_lying_reference():
    first, again = (estimate_bytes(Ekf().run(TAGGED.view(), seed=3)) for _ in range(2))
    lied = estimate_bytes(Ekf().run(edits.poisoned(TAGGED).view(), seed=3))

    assert first == again == lied


def test_a_run_keeps_axes_and_scalars(tmp_path):
    run = Run(Trial("b", "ekf", 0), Ekf().run(TAGGED.view(), seed=1))
    (tmp_path / "r.npz").write_bytes(run_bytes(run))
    back = read_run(tmp_path / "r.npz").estimate

    assert [i.axes for i in back.innovations] == [i.axes for i in run.estimate.innovations]
    assert dict(back.scalars) == dict(run.estimate.scalars)
    assert run_bytes(Run(run.trial, back)) == run_bytes(run)


def test_lasting_errors_of_sightings_keep_the_filter_modest():
    lasting = Noise(lasting_range_per_m=0.05, lasting_bearing_rad=0.02)
    plain, modest = (Ekf(noise).run(TAGGED.view(), seed=1).track for noise in (Noise(), lasting))

    assert (np.trace(modest.cov[50:], axis1=1, axis2=2)
            > 1.5 * np.trace(plain.cov[50:], axis1=1, axis2=2)).mean() > 0.9  # fmt: skip
    assert np.hypot(*error(modest)[50:, :2].T).max() < 0.15


def test_a_robot_at_rest_learns_nothing_from_looking_again():
    references, transforms = TAGGED.table("references"), TAGGED.table("transforms")
    moving = transforms["child_frame"] == "base_link"
    position = np.where(moving[:, None], 0.0, transforms["translation_xyz"])
    rotation = np.where(moving[:, None], [0.0, 0.0, 0.0, 1.0], transforms["rotation_xyzw"])
    still = transforms.replace(translation_xyz=position, rotation_xyzw=rotation)
    early = references.t_ns < START_NS + 10**9
    sensed = references["kind"] == "fiducial"
    view = TAGGED.view().with_table(still).with_table(references.take(early | ~sensed))
    estimate = Ekf().run(view, seed=1)

    seen = references["child_frame_id"][early & sensed]
    used = estimate.scalars["sightings_accepted"] + estimate.scalars["sightings_rejected"]
    assert used == len(set(seen))
    assert estimate.scalars["sightings_without_motion"] == len(seen) - len(set(seen)) > 0


def with_fixes(bundle, sigma=0.05, every=20):
    """A receiver that knows the map, its antenna off the base; every third fix is 20 m off."""
    rng = np.random.default_rng(0)
    t_s = np.arange(0.0, 20.0, 0.05 * every)
    antenna = np.array([0.3, -0.2, 0.0])
    at = se2.compose(true_path(t_s), antenna)
    at[:, :2] += sigma * rng.standard_normal((len(t_s), 2))
    at[3::3, 0] += 20.0
    fixes = table_of(
        "references", "/fix", t_s, kind="gnss", frame_id="map", child_frame_id="antenna",
        position_xyz=np.column_stack([at[:, :2], np.zeros(len(at))]),
        orientation_xyzw=np.full((len(at), 4), np.nan),
        covariance=np.tile(np.diag([sigma**2] * 3 + [np.nan] * 3).ravel(), (len(at), 1)),
    )  # fmt: skip
    mount = tf_rows("base_link", "antenna", np.zeros(1), antenna[None], is_static=True)
    whole = {name: [bundle.table(name), more] for name, more in
             (("references", fixes), ("transforms", mount))}  # fmt: skip
    view = bundle.view()
    for name, tables in whole.items():
        view = view.with_table(Table.concat(TABLES[name], tables))
    return view


def test_satellite_fixes_in_the_map_hold_the_pose_and_wild_ones_are_rejected():
    blind = edits.without(TAGGED, "sightings")
    estimate = Ekf().run(with_fixes(blind), seed=0)
    plain = Ekf().run(blind.view(), seed=0)
    (fixes,) = estimate.innovations

    assert (fixes.source, fixes.axes, fixes.frame_id) == ("gnss", ("x m", "y m"), "map")
    assert set(fixes.about) == {"/fix"}
    assert estimate.scalars["fixes_rejected"] == 6 == (~fixes.accepted).sum()
    assert estimate.scalars["fixes_accepted"] > 10
    assert np.hypot(*error(estimate.track)[100:, :2].T).max() < 0.15
    assert np.hypot(*error(plain.track)[100:, :2].T).max() > 0.18
    assert (np.linalg.det(estimate.track.cov[100:, :2, :2])
            < 0.1 * np.linalg.det(plain.track.cov[100:, :2, :2])).all()  # fmt: skip
