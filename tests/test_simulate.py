"""Logs that the simulator makes read back with rosbags, and hold what their README says of them."""

import hashlib
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from typer import Typer
from typer.testing import CliRunner

from slamreplay.errors import OutputError, UsageError
from slamreplay.geometry import se2
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.simulate import SCENARIOS, truth
from slamreplay.simulate.behavior import status_changes
from slamreplay.simulate.drive import BackUp, Carry, Follow, Pause, Slip, Spin, drive
from slamreplay.simulate.people import RADIUS_M, Walker, ranges_to
from slamreplay.simulate.pipeline import simulate
from slamreplay.simulate.recording import record
from slamreplay.simulate.samples import SAMPLES, readme
from slamreplay.simulate.scenarios import scenario
from slamreplay.simulate.topics import records
from slamreplay.simulate.worlds import (
    TRUE_RESOLUTION_M,
    World,
    box,
    rasterise,
    room_walls,
    warehouse,
)
from slamreplay.simulate.writer import write_log

SAMPLE_LOGS = Path(__file__).resolve().parents[1] / "sample_logs"
MB = 1_000_000


@cache
def sample(file_name):
    return read(SAMPLE_LOGS / file_name)


@cache
def short_round():
    return record(scenario("healthy_short"), 5)


def read(log):
    """Topic to its list of (log time in ns, message)."""
    found = {}
    with AnyReader([log]) as reader:
        for connection, t_ns, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            found.setdefault(connection.topic, []).append((t_ns, message))
    return found


def ns(stamp):
    return stamp.sec * 10**9 + stamp.nanosec


def planar(position, rotation):
    yaw = 2.0 * np.arctan2(rotation.z, rotation.w)
    return np.array([position.x, position.y, yaw])


def track(messages):
    stamps = np.array([ns(m.header.stamp) for _, m in messages])
    poses = [planar(m.pose.pose.position, m.pose.pose.orientation) for _, m in messages]
    return stamps, np.array(poses)


def transforms(topics, child):
    found = [(t, m.transforms[0]) for t, m in topics["/tf"]]
    return [(t, x) for t, x in found if x.child_frame_id == child]


def far_from_truth(topics):
    """Seconds, and where the belief at the reference's stamps is lost by definition."""
    t_ns, true = track(topics["/slamreplay/reference"])
    corrections = transforms(topics, "odom")
    arrived = np.array([t for t, _ in corrections])
    map_odom = np.array(
        [planar(x.transform.translation, x.transform.rotation) for _, x in corrections]
    )
    latest = np.searchsorted(arrived, t_ns, side="right") - 1
    t_ns, true, latest = t_ns[latest >= 0], true[latest >= 0], latest[latest >= 0]
    odometry = se2.interpolate(*track(topics["/odom"]), t_ns)
    belief = se2.compose(map_odom[latest], odometry)
    return (t_ns - t_ns[0]) / 1e9, truth.is_far(belief, true)


def changed_share(topics, standing):
    """Seconds, and the share of each scan's beams that met a change."""
    message = topics["/map"][0][1]
    info = message.info
    cells = np.array(message.data).reshape(info.height, info.width)
    origin = planar(info.origin.position, info.origin.orientation)
    grid = OccupancyGrid(cells, float(np.float32(info.resolution)), origin)
    mount = topics["/tf_static"][0][1].transforms[0].transform
    base_laser = planar(mount.translation, mount.rotation)
    scans = [m for _, m in topics["/scan"]]
    ranges = np.array([m.ranges for m in scans], dtype=np.float64)
    beams = np.arange(ranges.shape[1])
    first = scans[0]
    start = np.array([ns(m.header.stamp) for m in scans])
    at = start[:, None] + np.rint(beams * first.time_increment * 1e9).astype(np.int64)
    reference = track(topics["/slamreplay/reference"])
    rays = se2.compose(se2.interpolate(*reference, at.ravel()), base_laser)
    rays[:, 2] += np.tile(first.angle_min + beams * first.angle_increment, len(scans))
    changed = truth.changed_beams(grid, standing, rays, ranges.ravel(), first.range_max)
    share = changed.reshape(ranges.shape).sum(axis=1) / (ranges > 0.0).sum(axis=1)
    return (start - start[0]) / 1e9, share


@pytest.mark.parametrize("file_name", SAMPLES)
def test_sample_log_has_the_verdict_that_its_readme_expects(file_name):
    made = scenario(SAMPLES[file_name])
    topics = sample(file_name)

    t_s, far = far_from_truth(topics)
    standing = rasterise(made.standing, TRUE_RESOLUTION_M, as_map=False)
    verdict = truth.verdict(t_s, far, *changed_share(topics, standing))

    assert verdict == made.verdict
    if "healthy" in made.verdict:
        assert not far.any()
    if file_name == "lost_robot.mcap":
        assert far.mean() > 0.8
    if file_name in ("lost_robot.mcap", "changed_aisle.mcap", "lost_in_changed_aisle.mcap"):
        changes = [m.event_log[0] for _, m in topics["/behavior_tree_log"]]
        assert {"Spin", "Wait"} <= {c.node_name for c in changes}
    size = (SAMPLE_LOGS / file_name).stat().st_size
    assert size < (5 * MB if made.mapped.bounds[2] > 30.0 else 2 * MB)


def test_readme_of_the_sample_logs_is_current():
    assert (SAMPLE_LOGS / "README.md").read_text() == readme()


def test_sample_log_is_what_the_simulator_makes_today(tmp_path):
    """To a micrometre, for another machine's mathematics may round otherwise."""
    simulate("healthy_short", tmp_path / "now.db3")

    now, kept = read(tmp_path / "now.db3"), sample("healthy_short.db3")

    assert {t: len(m) for t, m in now.items()} == {t: len(m) for t, m in kept.items()}
    np.testing.assert_allclose(
        track(now["/slamreplay/reference"])[1], track(kept["/slamreplay/reference"])[1], atol=1e-6
    )


def test_corridor_is_100_m_and_ends_where_it_began():
    topics = sample("corridor_100m.mcap")
    _, true = track(topics["/slamreplay/reference"])
    _, odometry = track(topics["/odom"])

    off = np.hypot(*(se2.compose(true[0], odometry[-1]) - true[-1])[:2])

    assert np.hypot(*np.diff(true[:, :2], axis=0).T).sum() == pytest.approx(100.0, abs=0.5)
    assert np.hypot(*(true[-1] - true[0])[:2]) < 0.05
    assert 1.0 < off < 3.0


@pytest.mark.parametrize("suffix", [".mcap", ".db3", ".bag", ""])
def test_same_recording_gives_same_bytes_in_every_container(tmp_path, suffix):
    digests = []
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        target = tmp_path / name / f"log{suffix}"
        write_log(target, lambda messages: records(short_round(), messages))
        files = sorted(p for p in (tmp_path / name).rglob("*") if p.is_file())
        digests.append([(p.name, hashlib.sha256(p.read_bytes()).hexdigest()) for p in files])
    assert digests[0] == digests[1]

    topics = read(target)
    assert len(topics["/scan"]) > 100
    assert len(topics["/map"]) == 1
    assert {m.header.frame_id for _, m in topics["/local_costmap/costmap"]} == {"odom"}


def test_seed_decides_every_byte(tmp_path):
    for name, seed in (("a", 5), ("b", 5), ("c", 6)):
        simulate("healthy_short", tmp_path / f"{name}.mcap", seed=seed)
    one, same, other = ((tmp_path / f"{name}.mcap").read_bytes() for name in "abc")

    assert one == same
    assert one != other


def test_stamps_run_ahead_of_log_times_only_where_amcl_does_so():
    topics = sample("healthy.mcap")

    for topic in ("/scan", "/odom", "/imu", "/amcl_pose", "/slamreplay/reference"):
        late = np.array([t - ns(m.header.stamp) for t, m in topics[topic]]) / 1e9
        assert (late > 0.0).all()
        assert (late < 0.12).all()
        assert (np.diff([t for t, _ in topics[topic]]) >= 0).all()
    ahead = [ns(x.header.stamp) - t for t, x in transforms(topics, "odom")]
    assert (np.array(ahead) > 0.8e9).all()


@pytest.mark.parametrize("name", SCENARIOS)
def test_tour_keeps_clear_of_what_stands(name):
    made = scenario(name)
    standing = rasterise(made.standing, 0.05, as_map=False)
    mapped = rasterise(made.mapped, 0.05, as_map=False)
    motion = drive(made.start, made.tour)
    cells = standing.cell_of(motion.xyyaw[:, :2])

    from scipy.ndimage import distance_transform_edt

    distance = distance_transform_edt(~standing.occupied, sampling=0.05)
    assert distance[cells[:, 0], cells[:, 1]].min() > 0.35
    assert not mapped.occupied[cells[:, 0], cells[:, 1]].any()


def test_slip_and_carrying_part_the_wheels_from_the_truth():
    slipping = drive(
        (0.0, 0.0, 0.0), (Follow(((4.0, 0.0),), slip=Slip(1.0, 2.0, grip=0.5, yaw_rate=0.1)),)
    )
    carried = drive((0.0, 0.0, 0.0), (Pause(1.0), Carry((3.0, 1.0, 1.0))))

    assert np.trapezoid(slipping.wheels[:, 0], slipping.t_s) == pytest.approx(4.8, abs=0.15)
    np.testing.assert_allclose(slipping.xyyaw[-1, :2], [4.0, 0.0], atol=0.03)
    assert not carried.wheels.any()
    np.testing.assert_allclose(carried.xyyaw[-1], [3.0, 1.0, 1.0], atol=0.01)


def test_steps_move_as_they_are_asked_to():
    motion = drive((1.0, 2.0, 0.5), (Spin(1.2), BackUp(0.4)))
    turned = motion.xyyaw[motion.phases[1].first]

    assert turned == pytest.approx([1.0, 2.0, 1.7], abs=0.02)
    assert se2.between(turned, motion.xyyaw[-1])[0] == pytest.approx(-0.4, abs=0.02)
    assert (np.abs(np.diff(motion.twist[:, 0])) < 0.02).all()


def test_blocked_path_fails_in_the_tree_and_recoveries_follow():
    tour = (Follow(((1.0, 0.0),)), Spin(1.0), Pause(1.0, "Wait"), Follow(((1.0, 1.0),)))

    log = status_changes(drive((0.0, 0.0, 0.0), tour))

    assert [(c.node, c.after) for c in log if c.node in ("FollowPath", "Spin", "Wait")] == [
        ("FollowPath", "RUNNING"),
        ("FollowPath", "FAILURE"),
        ("Spin", "RUNNING"),
        ("Spin", "SUCCESS"),
        ("Wait", "RUNNING"),
        ("Wait", "SUCCESS"),
        ("FollowPath", "RUNNING"),
        ("FollowPath", "SUCCESS"),
    ]
    assert [c.t_s for c in log] == sorted(c.t_s for c in log)
    assert sum(c.node == "NavigateRecovery" for c in log) == 2


def test_person_blocks_the_rays_that_meet_them():
    walker = Walker(((2.0, 0.0), (2.0, 4.0)), speed=1.0)
    rays = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.2], [0.0, 0.0, np.pi], [0.0, 3.0, 0.0]])

    seen = ranges_to((walker,), np.array([0.0, 0.0, 0.0, 3.0]), rays)

    assert seen == pytest.approx([2.0 - RADIUS_M, np.inf, np.inf, 2.0 - RADIUS_M])


HALL = World((0.0, 0.0, 10.0, 10.0), room_walls("wall", (0.0, 0.0, 10.0, 10.0)))


@pytest.mark.parametrize(
    ("without", "added", "reach", "changed"),
    [
        ((), (), 7.0, False),
        ((), (box("pallet", 4.0, 4.0, 1.0, 2.0),), 3.0, True),
        (("rack",), (), 9.0, True),
        (("rack",), (box("rack", 7.9, 4.0, 1.0, 2.0),), 6.9, False),  # moved by less than 0.25 m
        ((), (), 3.0, False),  # a person: nothing stands there
        ((), (), np.inf, False),  # no return where a rack still stands is no change
        (("rack",), (), np.inf, True),
    ],
)
def test_changed_beam_is_what_the_definition_says(without, added, reach, changed):
    mapped = HALL.changed(added=(box("rack", 8.0, 4.0, 1.0, 2.0),))
    standing = mapped.changed(without=without, added=added)
    map_grid = rasterise(mapped, 0.05, as_map=True)
    ray = np.array([[1.0, 5.0, 0.0]])

    found = truth.changed_beams(
        map_grid, rasterise(standing, 0.025, as_map=False), ray, np.array([reach]), 12.0
    )

    assert found.tolist() == [changed]


def test_total_time_bridges_gaps_and_leaves_out_what_is_short():
    t_s = np.arange(0.0, 20.0, 0.1)
    holds = ((t_s > 2.0) & (t_s < 4.0)) | ((t_s > 4.5) & (t_s < 7.0)) | ((t_s > 10) & (t_s < 11))

    assert truth.total_s(t_s, holds, 3.0) == pytest.approx(4.9, abs=0.25)
    assert truth.total_s(t_s, np.ones(200, dtype=bool), 3.0) == pytest.approx(19.9)
    assert truth.total_s(t_s, np.zeros(200, dtype=bool), 3.0) == 0.0


def test_map_leaves_unknown_what_no_mapper_sees():
    grid = rasterise(warehouse(), 0.05, as_map=True)

    inside_rack, in_aisle, outside = grid.cell_of([[5.0, 2.9], [5.0, 4.6], [-0.5, 5.0]])

    assert grid.cells[tuple(inside_rack)] == -1
    assert grid.cells[tuple(in_aisle)] == 0
    assert grid.cells[tuple(outside)] == -1


def test_bad_requests_are_refused_and_leave_nothing(tmp_path):
    with pytest.raises(UsageError, match="lost_robot"):
        simulate("lost", tmp_path / "a.mcap")
    with pytest.raises(OutputError, match=r"\.txt"):
        simulate("healthy_short", tmp_path / "a.txt")
    with pytest.raises(OutputError):
        simulate("healthy_short", tmp_path / "no" / "such" / "a.mcap")
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.tex").write_text("mine")
    with pytest.raises(OutputError):
        simulate("healthy_short", tmp_path / "mine")

    assert [p.name for p in tmp_path.iterdir()] == ["mine"]
    assert [p.name for p in (tmp_path / "mine").iterdir()] == ["thesis.tex"]


def test_command_writes_the_log_and_says_where(tmp_path):
    from slamreplay.cli import simulate as command

    app = Typer()
    command.register(app)
    target = tmp_path / "log.bag"

    result = CliRunner().invoke(app, ["healthy_short", "-o", str(target)])
    nothing = CliRunner().invoke(app, ["-o", str(target)])

    assert result.stdout.strip() == str(target)
    assert target.read_bytes().startswith(b"#ROSBAG V2.0")
    assert isinstance(nothing.exception, UsageError)
