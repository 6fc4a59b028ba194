"""Tags, docks and satellite fixes join hindsight; what only judges does not."""

from dataclasses import replace

import numpy as np
import pytest

from slamreplay.bundle.fixes import satellite_fixes
from slamreplay.bundle.mounting import planar_mount
from slamreplay.bundle.odometry import odometry_track
from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.sightings import sightings_of
from slamreplay.bundle.tables import Table
from slamreplay.bundle.track import PoseTrack
from slamreplay.errors import UsageError
from slamreplay.geometry import se2, se3
from slamreplay.geometry.geodesy import earth_from_geodetic, enu_axes
from slamreplay.hindsight.chain import Chain
from slamreplay.hindsight.pipeline import hindsight
from slamreplay.hindsight.places import Hypotheses
from slamreplay.hindsight.sensed import Sensed
from slamreplay.hindsight.sensing import sensed
from slamreplay.hindsight.submaps import Submap
from slamreplay.hindsight.witnessed import witnessed_places
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.postmortem import postmortem
from slamreplay.testing.edits import poisoned, rebuilt
from slamreplay.testing.synthetic import START_NS, room_grid, synthetic_bundle, true_path

#: z ahead, x right, y down, as an image has them; on the robot, 20 cm ahead and looking right.
OPTICAL = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
CAMERA = se3.from_planar(np.array([0.2, -0.05, -0.6]))
CAMERA[:3, :3] = CAMERA[:3, :3] @ OPTICAL
#: Looking up, turned by a quarter.
UPWARDS = se3.from_planar(np.array([0.1, 0.03, -np.pi / 2]))
MIDDLE = se2.compose(room_grid().origin_xyyaw, np.array([6.0, 4.5, 0.0]))


def tag(x, y, yaw, z=0.8):
    """A tag on a wall, in the map; x, y in the room."""
    T = se3.from_planar(se2.compose(room_grid().origin_xyyaw, np.array([x, y, yaw])))
    T[:3, :3] = T[:3, :3] @ OPTICAL
    T[2, 3] = z
    return T


TAGS = {"tag_1": tag(11.8, 4.0, 0.0), "tag_2": tag(5.0, 8.8, np.pi / 2)}


def quaternion(R):
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(R).as_quat()


def rows(table, t_s, **columns):
    t_ns = START_NS + np.round(t_s * 1e9).astype(np.int64)
    times = {"t_ns": t_ns, "t_sensor_ns": t_ns, "t_log_ns": t_ns}
    topic = np.full(len(t_ns), "/tags", dtype=object)
    return Table(TABLES[table], {**times, "topic": topic, **columns})


def names(text, count):
    return np.full(count, text, dtype=object)


def seeing(view, tags, seconds, *, camera=CAMERA, in_tf=True, far=4.0, kind="fiducial", seed=0):
    """The view with sightings of tags within 4 m, 1 cm of noise, at 5 Hz."""
    rng = np.random.Generator(np.random.PCG64(seed))
    t_s = np.arange(0.0, seconds, 0.2)
    T_camera_map = np.linalg.inv(se3.from_planar(true_path(t_s)) @ camera)
    found = [view.table("references")]
    for name, T in tags.items():
        seen = T_camera_map @ T
        near = np.linalg.norm(seen[:, :3, 3], axis=1) < far
        n = int(near.sum())
        found.append(rows(
            "references", t_s[near], frame_id=names("camera", n), child_frame_id=names(name, n),
            kind=names(kind, n), covariance=np.full((n, 36), np.nan),
            position_xyz=seen[near, :3, 3] + rng.normal(0.0, 0.01, (n, 3)),
            orientation_xyzw=quaternion(seen[near, :3, :3]),
        ))  # fmt: skip
    view = view.with_table(Table.concat(TABLES["references"], found).sorted_by_time())
    return with_edge(view, "base_link", "camera", camera) if in_tf else view


def as_points(view):
    """The view without what its sightings say of how a thing is turned."""
    table = view.table("references")
    return view.with_table(table.replace(orientation_xyzw=np.full((len(table), 4), np.nan)))


def with_edge(view, parent, child, T):
    edge = rows(
        "transforms", np.zeros(1), parent_frame=names(parent, 1), child_frame=names(child, 1),
        is_static=np.ones(1, dtype=bool), translation_xyz=T[None, :3, 3],
        rotation_xyzw=quaternion(T[None, :3, :3]),
    )  # fmt: skip
    tables = [view.table("transforms"), edge]
    return view.with_table(Table.concat(TABLES["transforms"], tables))


def misses(found):
    t_s = (found.track.t_ns - found.track.t_ns[0]) / 1e9
    return np.hypot(*(found.track.xyyaw - true_path(t_s))[:, :2].T)


def mirrored(T):
    """The same, turned by half about the middle of the room."""
    turn = se3.from_planar(se2.compose(MIDDLE, np.array([0.0, 0.0, np.pi])))
    return turn @ np.linalg.inv(se3.from_planar(MIDDLE)) @ T


@pytest.fixture(scope="module")
def alike():
    """A room that looks the same turned by half, and a log in it."""
    cells = room_grid().cells
    room = OccupancyGrid(np.maximum(cells, cells[::-1, ::-1]), 0.05, room_grid().origin_xyyaw)
    return synthetic_bundle(seconds=20.0, world=room).view().with_grid(room)


@pytest.mark.parametrize("is_mirrored", [False, True])
def test_a_surveyed_tag_tells_two_like_places_apart(alike, is_mirrored):
    view = seeing(alike, TAGS, 20.0)
    for name, T in TAGS.items():
        view = with_edge(view, "map", name, mirrored(T) if is_mirrored else T)
    found = hindsight(view)

    assert (np.median(misses(found)) > 1.0) == is_mirrored
    assert found.margin > 0.04
    assert found.joined["fiducial"] > 5


@pytest.mark.parametrize("is_mirrored", [False, True])
def test_surveyed_points_tell_two_like_places_apart_too(alike, is_mirrored):
    view = as_points(seeing(alike, TAGS, 20.0))
    for name, T in TAGS.items():
        turned = T @ se3.from_planar(np.array([0.0, 0.0, 1.3]))  # what a survey says of a heading
        view = with_edge(view, "map", name, mirrored(turned) if is_mirrored else turned)
    found = hindsight(view)

    assert (np.median(misses(found)) > 1.0) == is_mirrored
    assert found.margin > 0.03
    assert found.joined["fiducial"] > 5


def test_tags_at_unknown_places_move_along_with_the_room_and_prove_nothing(alike):
    without, found = hindsight(alike), hindsight(seeing(alike, TAGS, 20.0))

    assert found.margin == pytest.approx(without.margin, abs=1e-3)
    assert found.margin < 0.02


@pytest.fixture(scope="module")
def healthy():
    return synthetic_bundle(seconds=20.0)


def test_tags_and_docks_do_not_harm_a_healthy_log(healthy):
    view = seeing(healthy.view(), TAGS, 20.0)
    view = seeing(view, {"dock": tag(0.3, 4.0, np.pi)}, 20.0, kind="dock", in_tf=False)
    found = hindsight(view)

    assert set(found.joined) == {"fiducial", "dock"}
    assert np.percentile(misses(found), 95) < 0.05
    assert (
        np.percentile(misses(found), 95)
        < np.percentile(misses(hindsight(healthy.view())), 95) + 0.01
    )


def test_points_at_unknown_places_do_not_harm_a_healthy_log(healthy):
    found = hindsight(as_points(seeing(healthy.view(), TAGS, 20.0)))

    assert set(found.joined) == {"fiducial"}
    assert np.percentile(misses(found), 95) < 0.05


def test_nothing_takes_an_orientation_that_was_not_sensed(healthy):
    view = seeing(healthy.view(), TAGS, 20.0)
    surveyed = with_edge(view, "map", "tag_1", TAGS["tag_1"])
    with_heading = sightings_of(surveyed, odometry_track(view))
    points = sightings_of(as_points(surveyed), odometry_track(view))

    np.testing.assert_array_equal(points.xyyaw[:, :2], with_heading.xyyaw[:, :2])
    assert np.isnan(points.xyyaw[:, 2]).all()
    assert np.isnan(points.surveyed["fiducial tag_1"][2])
    np.testing.assert_array_equal(points.cov[:, :2, :2], with_heading.cov[:, :2, :2])
    np.testing.assert_allclose(np.sqrt(points.cov[:, 2, 2]), np.pi / np.sqrt(3.0))


def test_references_that_only_judge_change_no_bit(healthy):
    one, two = hindsight(healthy.view()), hindsight(poisoned(healthy).view())

    assert one.track.xyyaw.tobytes() == two.track.xyyaw.tobytes()
    assert one.track.cov.tobytes() == two.track.cov.tobytes()
    assert one.match.tobytes() == two.match.tobytes()


def test_the_base_sees_a_tag_where_it_is(healthy):
    view = seeing(healthy.view(), TAGS, 20.0)
    seen = sightings_of(view, odometry_track(view))
    t_s = (seen.t_ns - START_NS) / 1e9
    for name, T in TAGS.items():
        row = seen.name == f"fiducial {name}"
        at = se2.compose(true_path(t_s[row]), seen.xyyaw[row])
        np.testing.assert_allclose(at[:, :2], np.tile(T[:2, 3], (row.sum(), 1)), atol=0.06)
        assert np.ptp(np.unwrap(at[:, 2])) < 0.01


@pytest.mark.parametrize("camera", [CAMERA, UPWARDS])
def test_a_camera_that_tf_does_not_place_is_placed_by_what_it_saw(camera):
    tags = {f"tag_{i}": tag(x, y, 0.0, z=2.6) for i, (x, y) in enumerate([(3, 3), (9, 3), (6, 6)])}
    bundle = synthetic_bundle(seconds=40.0)
    view = seeing(bundle.view(), tags, 40.0, camera=camera, in_tf=False, far=5.0)
    table = view.table("references").sorted_by_time()
    rng = np.random.Generator(np.random.PCG64(2))
    t_s = np.arange(0.0, 40.0, 0.25)
    way = true_path(t_s) + rng.normal(0.0, [0.01, 0.01, 0.003], (len(t_s), 3))
    t_ns = START_NS + np.round(t_s * 1e9).astype(np.int64)
    motion = PoseTrack.without_covariance("matched", "base_link", t_ns, way)
    T = planar_mount(table.t_ns, table["child_frame_id"], table["position_xyz"], motion)

    np.testing.assert_allclose(T[:2, 3], camera[:2, 3], atol=0.05)
    assert np.degrees(np.arccos((np.trace(T[:3, :3].T @ camera[:3, :3]) - 1) / 2)) < 2.0


def test_a_camera_that_saw_nothing_while_the_robot_turned_is_not_placed():
    t_ns = START_NS + np.arange(50) * 100_000_000
    name = names("tag_1", 50)
    view = synthetic_bundle(seconds=6.0).view()
    ahead = np.tile([0.0, 0.0, 2.0], (50, 1)) + 0.001 * np.arange(50)[:, None]

    assert planar_mount(t_ns, name, ahead, odometry_track(view)) is None


def test_satellite_fixes_join_in_a_frame_of_their_own(healthy):
    rng = np.random.Generator(np.random.PCG64(1))
    t_s = np.arange(0.0, 20.0, 0.2)
    turned = se2.compose(np.array([300.0, -40.0, 2.2]), true_path(t_s))
    enu = np.column_stack([turned[:, :2] + rng.normal(0.0, 0.05, (len(t_s), 2)), 0 * t_s])
    earth = earth_from_geodetic([48.1, 11.5, 520.0]) + enu @ enu_axes(48.1, 11.5)
    cov = np.zeros((len(t_s), 6, 6))
    cov[:, range(3), range(3)] = 0.05**2
    fixes = rows(
        "references", t_s, frame_id=names("earth", len(t_s)), child_frame_id=names("", len(t_s)),
        kind=names("gnss", len(t_s)), position_xyz=earth, covariance=cov.reshape(-1, 36),
        orientation_xyzw=np.tile([0.0, 0.0, 0.0, 1.0], (len(t_s), 1)),
    )  # fmt: skip
    view = healthy.view()
    tables = [view.table("references"), fixes]
    view = view.with_table(Table.concat(TABLES["references"], tables))
    assert np.allclose(np.diff(satellite_fixes(view).xy, axis=0), np.diff(enu[:, :2], axis=0),
                       atol=1e-3)  # fmt: skip
    found = hindsight(view)

    assert found.joined["gnss"] > 20
    assert np.percentile(misses(found), 95) < 0.05
    key_ns = START_NS + np.arange(0, 20, 1) * 1_000_000_000
    poses = true_path(np.arange(20.0))
    beside = sensed(view, odometry_track(view), key_ns, poses, np.zeros(3))
    frame = beside.constraints(poses)[1].initial
    expected = se2.compose(se2.inverse(np.array([300.0, -40.0, 2.2])), np.array([*enu[0, :2], 0.0]))
    np.testing.assert_allclose(frame, expected, atol=0.1)


def three_submaps(first, second):
    """Three stretches of one keyframe each, carried in between, with places to choose from."""
    poses = np.zeros((3, 3))
    chain = Chain(poses, np.ones(3), np.ones(3, bool), np.ones(3, bool), np.zeros((3, 3, 3)))
    found = [Submap(k, k + 1, k, np.zeros((1, 2)), np.zeros((1, 4))) for k in range(3)]
    far = np.array([[50.0, 0.0, 0.0]])
    lists = [Hypotheses(np.concatenate([np.array(p, float), far]), np.array([*s, 0.2]))
             for p, s in ((first, [0.9, 0.89][: len(first)]), (second, [0.8, 0.79][: len(second)]),
                          ([[9.0, 9.0, 0.0]], [0.9]))]  # fmt: skip
    return chain, found, lists


def seen_by(keys, xyyaw, surveyed=(np.nan, np.nan, np.nan)):
    empty = np.empty(0, dtype=np.int64)
    return Sensed(
        np.array(keys), np.zeros(len(keys), dtype=np.int64), np.array(xyyaw),
        np.tile(np.eye(3) * 0.01, (len(keys), 1, 1)), ("fiducial tag_1",), np.array([surveyed]),
        empty, np.empty((0, 3)), np.empty((0, 2)), np.empty((0, 2, 2)),
    )  # fmt: skip


def test_a_surveyed_point_is_a_known_landmark_without_a_heading():
    seen = seen_by([0, 1], [[2.0, 1.0, np.nan]] * 2, (4.0, 3.0, np.nan))
    landmarks, _ = seen.constraints(np.zeros((2, 3)))

    assert landmarks.known.tolist() == [True]
    np.testing.assert_array_equal(landmarks.initial, [[4.0, 3.0, np.nan]])


CARRIED = (np.tile([30.0, 30.0, 0.0], (2, 1)), np.full(2, 8.0))
AISLES = [[0.0, 5.0, 0.0], [0.0, 0.0, 0.0]]


def test_a_tag_seen_again_tells_which_of_two_like_aisles_it_was():
    chain, found, lists = three_submaps([[0.0, 0.0, 0.0]], AISLES)
    seen = seen_by([0, 1], [[2.0, 1.0, 0.5]] * 2)
    alone = witnessed_places(lists, *CARRIED, chain, found, None)
    told = witnessed_places(lists, *CARRIED, chain, found, seen)

    assert alone.xyyaw[1].tolist() == AISLES[0]  # it scores better by a hair
    assert told.xyyaw[1].tolist() == AISLES[1]
    assert told.score.tolist() == [0.9, 0.79, 0.9]


def test_a_tag_seen_from_two_doubtful_places_does_not_choose_between_them():
    chain, found, lists = three_submaps(AISLES, AISLES)
    seen = seen_by([0, 1], [[2.0, 1.0, 0.5]] * 2)
    alone = witnessed_places(lists, *CARRIED, chain, found, None)
    told = witnessed_places(lists, *CARRIED, chain, found, seen)

    assert told.xyyaw.tolist() == alone.xyyaw.tolist()
    assert told.margin == alone.margin


def test_one_moved_tag_does_not_overrule_scans_that_are_sure():
    chain, found, lists = three_submaps([[0.0, 0.0, 0.0]], AISLES)
    lists[1] = replace(lists[1], score=np.array([0.95, 0.6, 0.2]))
    seen = seen_by([0, 1], [[2.0, 1.0, 0.5]] * 2)

    assert witnessed_places(lists, *CARRIED, chain, found, seen).xyyaw[1].tolist() == AISLES[0]


def of(view):
    """A view as a bundle in memory."""
    return rebuilt(view.bundle, view.tables)


def with_truth(healthy, view):
    """The bundle of a view, what only judges included."""
    table = healthy.table("references")
    judging = table.take(table["kind"] == "simulation")
    sensed_rows = view.table("references")
    both = Table.concat(TABLES["references"], [judging, sensed_rows]).sorted_by_time()
    return of(view.with_table(both))


def test_what_is_held_out_judges_and_changes_no_bit(healthy):
    bundle = with_truth(healthy, seeing(healthy.view(), TAGS, 20.0))
    without = hindsight(healthy.view())
    kept = postmortem(bundle, hold_out=["fiducial"])
    used = postmortem(bundle)

    assert kept.hindsight.track.xyyaw.tobytes() == without.track.xyyaw.tobytes()
    assert used.hindsight.track.xyyaw.tobytes() != without.track.xyyaw.tobytes()
    (judged,) = [f for f in kept.findings if f.id == "SR-REF-002"]
    assert judged.value < 0.03
    assert judged.n > 20
    (joined,) = [f for f in used.findings if f.id == "SR-REF-001"]
    assert joined.n == used.hindsight.joined["fiducial"]


def test_only_what_the_robot_sensed_can_be_held_out(healthy):
    with pytest.raises(UsageError, match="dock, fiducial, gnss"):
        healthy.view(["simulation"])
