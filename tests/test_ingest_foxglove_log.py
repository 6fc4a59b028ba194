"""A whole log with Foxglove's schemas, as JSON and as protobuf, is the ROS 2 log of its numbers."""

import json

import numpy as np
import pytest
import typer
from foxglove_logs import PREFIX, to_ros, write_mcap
from typer.testing import CliRunner

from slamreplay.bundle.view import Bundle
from slamreplay.cli import ingest as ingest_command
from slamreplay.consistency.audits.inspection import inspect
from slamreplay.errors import UsageError
from slamreplay.ingest.options import IngestOptions
from slamreplay.ingest.pipeline import ingest
from slamreplay.testing.synthetic import room_grid, synthetic_bundle


def stamp(t_ns):
    return {"sec": int(t_ns) // 10**9, "nanosec": int(t_ns) % 10**9}


def xyz(values):
    return dict(zip("xyz", map(float, values), strict=True))


def pose(columns, row):
    turn = dict(zip("xyzw", map(float, columns["orientation_xyzw"][row]), strict=True))
    return {"position": xyz(columns["position_xyz"][row]), "orientation": turn}


def rows(bundle, table):
    """(header, row) of each row of a synthetic table, and its times."""
    columns = bundle.table(table)
    frames = columns["parent_frame" if table == "transforms" else "frame_id"]
    for row in range(len(columns)):
        at = {"stamp": stamp(columns["t_sensor_ns"][row]), "frame_id": frames[row]}
        yield row, at, int(columns["t_log_ns"][row])


def flat(header):
    return {"timestamp": header["stamp"], "frame_id": header["frame_id"]}


# Each gives (topic, log time, ROS type, ROS values, Foxglove type, Foxglove values) of a drive.
# fmt: off
def transforms(bundle):
    c = bundle.table("transforms")
    for row, header, t_ns in rows(bundle, "transforms"):
        turn = dict(zip("xyzw", map(float, c["rotation_xyzw"][row]), strict=True))
        motion = {"translation": xyz(c["translation_xyz"][row]), "rotation": turn}
        child = {"child_frame_id": c["child_frame"][row]}
        edge = {"timestamp": header["stamp"], "parent_frame_id": header["frame_id"]}
        yield (c["topic"][row], t_ns, "tf2_msgs/msg/TFMessage",
               {"transforms": [{"header": header, **child, "transform": motion}]},
               "FrameTransforms", {"transforms": [{**edge, **child, **motion}]})


def scans(bundle):
    c = bundle.table("scans")
    beams = c["ranges_m"].values.reshape(len(c), -1).copy()
    beams[::2, 3::40], beams[1::2, 7::40] = np.inf, np.nan
    reach = float(beams[np.isfinite(beams)].max())  # all that Foxglove's schema lets us know
    start, step = float(np.float32(c["angle_min_rad"][0])), float(np.float32(4.4 / 180))
    for row, header, t_ns in rows(bundle, "scans"):
        yield ("/scan", t_ns, "sensor_msgs/msg/LaserScan",
               {"header": header, "angle_min": start, "angle_increment": step,
                "range_max": reach, "ranges": beams[row]},
               "LaserScan",
               {**flat(header), "start_angle": start, "end_angle": start + 180 * step,
                "ranges": beams[row].astype(float).tolist()})


def odometry(bundle):
    c = bundle.table("odometry")
    for row, header, t_ns in rows(bundle, "odometry"):
        linear, angular = (xyz(c[f"{n}_velocity_xyz"][row]) for n in ("linear", "angular"))
        covariance = [float(row + k) for k in range(36)]
        yield ("/odom", t_ns, "nav_msgs/msg/Odometry",
               {"header": header, "child_frame_id": "base_link",
                "pose": {"pose": pose(c, row), "covariance": covariance},
                "twist": {"twist": {"linear": linear, "angular": angular},
                          "covariance": covariance}},
               "Odometry",
               {**flat(header), "body_frame_id": "base_link", "pose": pose(c, row),
                "linear_velocity": linear, "angular_velocity": angular,
                "pose_covariance": covariance, "velocity_covariance": covariance})


def beliefs(bundle):
    c = bundle.table("poses")
    for row, header, t_ns in rows(bundle, "poses"):
        poses, at = [pose(c, row), pose(c, row // 2)], flat(header)
        yield ("/robot_pose", t_ns, "geometry_msgs/msg/PoseStamped",
               {"header": header, "pose": poses[0]},
               "PoseInFrame", {**at, "pose": poses[0]})
        yield ("/particle_cloud", t_ns, "geometry_msgs/msg/PoseArray",
               {"header": header, "poses": poses}, "PosesInFrame", {**at, "poses": poses})
        yield ("/plan", t_ns, "nav_msgs/msg/Path",
               {"header": header, "poses": [{"header": header, "pose": p} for p in poses]},
               "PosesInFrame", {**at, "poses": poses})


def others(bundle):
    data = np.array([[1.0, 2.0, 0.5], [3.0, -4.0, 0.25]], dtype="<f4").tobytes()
    axes = [{"name": name, "offset": 4 * k} for k, name in enumerate("xyz")]
    for row, header, t_ns in rows(bundle, "poses"):
        at = flat(header)
        fix = {"latitude": 48.0 + row, "longitude": 11.0, "altitude": 500.0,
               "position_covariance": [float(k) for k in range(9)],
               "position_covariance_type": 2}
        line = {"level": 4, "name": "amcl"}
        yield ("/points", t_ns, "sensor_msgs/msg/PointCloud2",
               {"header": header, "height": 1, "width": 2, "point_step": 12, "row_step": 24,
                "data": data, "fields": [{**axis, "datatype": 7} for axis in axes]},
               "PointCloud",
               {**at, "point_stride": 12, "data": data,
                "fields": [{**axis, "type": 7} for axis in axes]})
        yield ("/gps/fix", t_ns, "sensor_msgs/msg/NavSatFix", {"header": header, **fix},
               "LocationFix", {**at, **fix})
        yield ("/rosout", t_ns, "rcl_interfaces/msg/Log",
               {"stamp": header["stamp"], **line, "msg": "lost"},
               "Log", {"timestamp": header["stamp"], **line, "message": "lost"})


def grids(bundle):
    known, t_ns = room_grid(), int(bundle.table("scans")["t_log_ns"][0])
    header, half = {"stamp": stamp(t_ns), "frame_id": "map"}, known.origin_xyyaw[2] / 2
    turn = {"x": 0.0, "y": 0.0, "z": float(np.sin(half)), "w": float(np.cos(half))}
    origin = {"position": xyz([*known.origin_xyyaw[:2], 0.0]), "orientation": turn}
    for topic, cells in (("/map", known.cells), ("/local_costmap", known.cells[:20, :30])):
        height, width = cells.shape
        padded = np.full((height, width + 3, 2), 77, dtype=np.int8)
        padded[:, :width, 1] = cells
        yield (topic, t_ns, "nav_msgs/msg/OccupancyGrid",
               {"header": header, "data": cells.tobytes(),
                "info": {"resolution": 0.05, "width": width, "height": height,
                         "origin": origin}},
               "Grid",
               {**flat(header), "pose": origin, "column_count": width,
                "cell_size": {"x": 0.05, "y": 0.05}, "row_stride": 2 * (width + 3),
                "cell_stride": 2, "data": padded.tobytes(),
                "fields": [{"name": "before", "offset": 0, "type": 1},
                           {"name": "occupancy", "offset": 1, "type": 2}]})
# fmt: on


def drive():
    """All messages of a drive in log order."""
    bundle = synthetic_bundle(seconds=3.0)
    makers = (transforms, scans, odometry, beliefs, others, grids)
    return sorted((m for make in makers for m in make(bundle)), key=lambda message: message[1])


@pytest.fixture(scope="module")
def messages():
    return drive()


def ros_log(logs, name, messages):
    """A ROS 2 log of (topic, type, values, log time)."""
    store = logs.stores[2]
    return logs.write(name, [(topic, kind, to_ros(store, kind, values), t_ns)
                             for topic, kind, values, t_ns in messages])  # fmt: skip


@pytest.fixture
def ros(messages, logs, tmp_path):
    """The bundle of the ROS 2 log."""
    own = [(topic, kind, values, t_ns) for topic, t_ns, kind, values, *_ in messages]
    return ingest([ros_log(logs, "ros.mcap", own)], tmp_path / "ros.bundle")


def in_foxglove(messages):
    return [(topic, name, values, t_ns) for topic, t_ns, _, _, name, values in messages]


def app():
    program = typer.Typer()
    ingest_command.register(program)
    program.command("other")(lambda: None)
    return program


@pytest.mark.parametrize("encoding", ["json", "protobuf", "cdr"])
def test_tables_roles_frames_and_map_are_those_of_the_ros_log(
    messages, ros, logs, tmp_path, encoding
):
    path, target = tmp_path / f"{encoding}.mcap", tmp_path / "fox.bundle"
    own = in_foxglove(messages)
    if encoding == "cdr":
        ros_log(logs, path.name, [(topic, PREFIX + name, *rest) for topic, name, *rest in own])
    else:
        write_mcap(path, own, encoding)
    done = CliRunner().invoke(app(), ["ingest", str(path), "-o", str(target)])
    assert done.exit_code == 0, done.output
    fox = Bundle.open(target)

    assert {name for name, entry in ros.manifest.tables.items() if entry.rows} == {
        "scans", "odometry", "transforms", "poses", "particles", "plans", "costmaps",
        "references", "health", "map_updates",
    }  # fmt: skip
    for name, entry in ros.manifest.tables.items():
        expected, got = ros.table(name).to_arrow(), fox.table(name).to_arrow()
        for column in expected.column_names:
            said = [repr(table[column].to_pylist()) for table in (got, expected)]
            assert said[0] == said[1], (name, column)
        assert fox.manifest.tables[name] == entry, name  # the same bytes, NaN and all
    assert {r.role: r.topic for r in fox.manifest.roles} == {
        "scan": "/scan", "odometry": "/odom", "pose": "/tf", "map": "/map",
        "costmap": "/local_costmap", "particles": "/particle_cloud", "plan": "/plan",
    }  # fmt: skip
    assert [(r.role, r.topic, r.messages) for r in fox.manifest.roles] == [
        (r.role, r.topic, r.messages) for r in ros.manifest.roles
    ]
    assert fox.manifest.frames == ros.manifest.frames
    assert fox.manifest.clock == ros.manifest.clock
    assert fox.manifest.missing == ros.manifest.missing
    assert [m.version for m in fox.manifest.maps] == [m.version for m in ros.manifest.maps]
    reasons = {r.role: r.reason for r in fox.manifest.roles}
    assert reasons["odometry"] == "foxglove_msgs/Odometry, the only one"
    assert reasons["plan"] == "foxglove_msgs/PosesInFrame, the only one"
    assert reasons["scan"] == "foxglove_msgs/LaserScan, the only one"
    losses = {(loss.kind, loss.what, loss.reason): loss.count for loss in fox.manifest.losses}
    assert "lost" not in {kind for kind, _, _ in losses}
    # The schema wants a pose in every scan; protobuf leaves out what is nothing.
    without = ("repaired", "/scan", "no 'pose' in it: taken as zero or empty")
    assert losses.get(without) == (30 if encoding == "json" else None)


@pytest.mark.parametrize("spelling", ["foxglove/{}", "foxglove_msgs/msg/{}", "foxglove_msgs/{}"])
def test_the_schemas_other_names_mean_the_same(messages, ros, tmp_path, spelling):
    path = write_mcap(
        tmp_path / "log.mcap", in_foxglove(messages), "json", schema_name=spelling.format
    )
    fox = ingest([path], tmp_path / "fox.bundle")
    assert fox.manifest.tables == ros.manifest.tables


def test_a_pose_in_the_map_is_the_belief_where_tf_has_none(messages, tmp_path):
    own = [m for m in in_foxglove(messages) if m[0] != "/tf"]
    fox = ingest([write_mcap(tmp_path / "log.mcap", own, "protobuf")], tmp_path / "fox.bundle")

    assert fox.manifest.topic_of("pose") == "/robot_pose"
    assert fox.manifest.frames.map == "map"


def test_transforms_may_be_called_otherwise(messages, tmp_path):
    """Nothing but ROS calls them /tf: the belief's rate is still told, fixed mounts still held."""
    renamed = [
        ("/frames" if m[0].startswith("/tf") else m[0], *m[1:]) for m in in_foxglove(messages)
    ]
    fox = ingest([write_mcap(tmp_path / "log.mcap", renamed, "json")], tmp_path / "fox.bundle")

    seen = inspect(fox)
    (pose_role,) = [role for role in seen["roles"] if role["role"] == "pose"]
    assert pose_role["topic"] == "/frames"
    assert pose_role["rate_hz"] > 1.0
    static = {(e["parent"], e["child"]) for e in seen["frames"]["tree"] if e["is_static"]}
    assert static == {("base_link", "laser")}


def test_scans_with_a_mount_of_their_own_need_no_tf_for_it(messages, tmp_path):
    own = []
    for topic, name, values, t_ns in in_foxglove(messages):
        if topic == "/scan":
            mount = {
                "position": xyz([0.15, 0.02, 0.3]),
                "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
            }
            values = {**values, "frame_id": "base_link", "pose": mount}
        if topic != "/tf_static":
            own.append((topic, name, values, t_ns))
    fox = ingest([write_mcap(tmp_path / "log.mcap", own, "json")], tmp_path / "fox.bundle")

    view = fox.view()
    assert set(fox.table("scans")["frame_id"]) == {"scan/pose"}
    T, valid = view.transforms.lookup("base_link", "scan/pose", fox.table("scans").t_ns)
    assert valid.all()
    np.testing.assert_allclose(T[:, :3, 3], np.tile([0.15, 0.02, 0.3], (len(T), 1)))
    assert inspect(fox)["frames"]["without_tf"] == []


def test_several_robots_are_told_apart(messages, tmp_path):
    two = [(f"/{robot}{m[0]}", *m[1:]) for robot in ("a", "b") for m in in_foxglove(messages)]
    path = write_mcap(tmp_path / "log.mcap", two, "protobuf")
    with pytest.raises(UsageError, match="2 robots: a, b"):
        ingest([path], tmp_path / "fox.bundle")

    one = ingest([path], tmp_path / "one.bundle", IngestOptions(robot="a"))
    assert one.manifest.topic_of("scan") == "/a/scan"


def test_a_log_of_nothing_known_says_so_in_the_manifest(messages, tmp_path):
    """A schema that is broken loses its topic, with a count, and no other."""
    from mcap.writer import Writer

    good = write_mcap(tmp_path / "good.mcap", in_foxglove(messages), "json")
    with (tmp_path / "odd.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema("foxglove.Grid", "protobuf", b"not a descriptor")
        channel = writer.register_channel("/grid", "protobuf", schema)
        other = writer.register_channel("/bare", "json", 0)
        for t_ns in range(3):
            writer.add_message(channel, t_ns, b"", t_ns)
            writer.add_message(other, t_ns, json.dumps({"a": 1}).encode(), t_ns)
        writer.finish()

    fox = ingest([good, tmp_path / "odd.mcap"], tmp_path / "fox.bundle")

    skipped = {loss.what: loss for loss in fox.manifest.losses if loss.kind == "skipped"}
    grid = skipped["/grid (foxglove_msgs/msg/Grid)"]
    assert (grid.count, grid.reason.partition(":")[0]) == (3, "its protobuf schema cannot be read")
    assert skipped["/bare (json)"].count == 3
