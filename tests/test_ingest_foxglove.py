"""Foxglove's schemas mean what their ROS siblings mean, packed numbers and poses included."""

import numpy as np
import pytest
from foxglove_logs import PREFIX, descriptors, read, to_json, to_protobuf, to_ros
from hypothesis import given, settings
from hypothesis import strategies as st
from type_store import type_store

from slamreplay.geometry import se3
from slamreplay.geometry.times import NO_STAMP
from slamreplay.ingest.decoders.grid import COST_SCALE

STORE = type_store()
STAMP = {"sec": 5, "nanosec": 6}
T = 5_000_000_006
ORIGIN = {"x": 0.0, "y": 0.0, "z": 0.0}
LEVEL = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}


def pose(x=0.0, y=0.0, z=0.0, xyzw=(0.0, 0.0, 0.0, 1.0)):
    turn = dict(zip("xyzw", map(float, xyzw), strict=True))
    return {"position": {"x": x, "y": y, "z": z}, "orientation": turn}


def decode(name, *values, topic="/topic", encoding="json"):
    """Rows of all tables by table, and losses, of messages in one encoding."""
    make = {
        "json": to_json,
        "protobuf": lambda v: to_protobuf(name, v).SerializeToString(),
        "cdr": lambda v: bytes(STORE.serialize_cdr(to_ros(STORE, PREFIX + name, v), PREFIX + name)),
    }[encoding]
    rows, losses = read(
        PREFIX + name, encoding, [make(v) for v in values], descriptors(name), topic
    )
    return {r.table: r for r in rows}, losses


def placed(frame="map", **values):
    return {"timestamp": STAMP, "frame_id": frame, **values}


@pytest.mark.parametrize("encoding", ["json", "protobuf", "cdr"])
def test_a_pose_in_every_encoding(encoding):
    turned = pose(1.0, 2.0, 3.0, (0, 0, 0.6, 0.8))
    tables, losses = decode("PoseInFrame", placed("/map", pose=turned), encoding=encoding)

    rows = tables["poses"]
    assert rows.frame() == "map"
    assert rows.t_sensor_ns.tolist() == [T]
    assert rows.columns["position_xyz"].tolist() == [[1, 2, 3]]
    assert rows.columns["orientation_xyzw"].tolist() == [[0, 0, 0.6, 0.8]]
    assert np.isnan(rows.columns["covariance"]).all()
    assert not losses


def test_a_pose_without_heading_or_stamp():
    still = pose(xyzw=(0, 0, 0, 0))
    tables, losses = decode(
        "PoseInFrame", placed(pose=still), {"frame_id": "map", "pose": pose()}, encoding="protobuf"
    )

    assert tables["poses"].t_sensor_ns.tolist() == [NO_STAMP]
    assert losses == {("lost", "quaternion is zero or not finite"): 1}


@pytest.mark.parametrize(
    ("topic", "table"),
    [("/particle_cloud", "particles"), ("/poses", "particles"), ("/global_plan", "plans"),
     ("/robot1/path", "plans"), ("/trajectory", "plans")],
)  # fmt: skip
def test_poses_are_particles_or_a_path_by_name(topic, table):
    poses = [pose(1.0, 2.0, xyzw=(0, 0, 1, 0)), pose(3.0, xyzw=(0, 0, 0, 0))]
    tables, losses = decode("PosesInFrame", placed(poses=poses), topic=topic)

    assert set(tables) == {table}
    xyyaw = tables[table].columns["xyyaw"][0].tolist()
    if table == "plans":  # a way point without orientation is a place
        assert xyyaw == [1, 2, np.pi, 3, 0, 0]
        assert not losses
    else:
        assert xyyaw == [1, 2, np.pi]
        assert losses == {("lost", "particles: quaternion is zero or not finite"): 1}


def test_transforms_one_by_one_and_together():
    def edge(child, **values):
        shift = {"x": 0.5, "y": 0.0, "z": 0.0}
        frames = {"parent_frame_id": "/odom", "child_frame_id": child}
        return {"timestamp": STAMP, **frames, "translation": shift, "rotation": LEVEL, **values}

    left_out = edge("b")
    del left_out["rotation"]
    for name, messages in (
        ("FrameTransform", [edge("a"), left_out, edge("")]),
        ("FrameTransforms", [{"transforms": [edge("a"), left_out, edge("")]}]),
    ):
        tables, losses = decode(name, *messages, encoding="protobuf")
        rows = tables["transforms"]
        assert rows.columns["child_frame"].tolist() == ["a", "b"]
        assert rows.columns["parent_frame"].tolist() == ["odom", "odom"]
        assert rows.columns["rotation_xyzw"].tolist() == [[0, 0, 0, 1]] * 2
        assert rows.columns["translation_xyz"][:, 0].tolist() == [0.5, 0.5]
        assert rows.t_sensor_ns.tolist() == [T, T]
        assert losses == {
            ("lost", "a frame without a name, or its own parent"): 1,
            ("repaired", "rotation left out, taken as none"): 1,
        }


def test_odometry():
    values = placed(
        "odom", body_frame_id="base", pose=pose(1.0),
        linear_velocity={"x": 0.5, "y": 0.0, "z": 0.0},
        angular_velocity={"x": 0.0, "y": 0.0, "z": 0.25}, pose_covariance=[0.5] * 36,
    )  # fmt: skip
    tables, losses = decode("Odometry", values, encoding="protobuf")

    columns = tables["odometry"].columns
    assert (columns["frame_id"][0], columns["child_frame_id"][0]) == ("odom", "base")
    assert columns["linear_velocity_xyz"].tolist() == [[0.5, 0, 0]]
    assert columns["angular_velocity_xyz"].tolist() == [[0, 0, 0.25]]
    assert columns["pose_covariance"].tolist() == [[0.5] * 36]
    assert columns["twist_covariance"].tolist() == [[0.0] * 36]
    assert not losses


def scan(ranges=(1.0, 2.0, 3.0), start=-1.0, end=1.0, at=None, frame="laser"):
    return placed(frame, pose=at or pose(), start_angle=start, end_angle=end, ranges=list(ranges))


def test_a_scan_reaches_as_far_as_its_farthest_return():
    far = scan((0.5, np.inf, np.nan), start=0.5, end=0.25)
    tables, losses = decode("LaserScan", scan(), far)

    columns = tables["scans"].columns
    assert columns["angle_min_rad"].tolist() == [-1.0, 0.5]
    assert columns["angle_increment_rad"].tolist() == [1.0, -0.125]
    assert columns["range_max_m"].tolist() == [3.0, 3.0]
    assert columns["range_min_m"].tolist() == [0.0, 0.0]
    np.testing.assert_array_equal(columns["ranges_m"][1], np.float32([0.5, np.inf, np.nan]))
    assert not losses


def test_scans_that_say_nothing_are_counted():
    tilted = scan(at=pose(xyzw=(0.3, 0, 0, 0.954)))
    lost = pose(float("nan"))
    tables, losses = decode(
        "LaserScan", scan(()), scan(end=np.inf), scan(end=-1.0), tilted, scan(at=lost),
        scan((1.0,), end=-1.0),
    )  # fmt: skip

    assert len(tables["scans"]) == 1
    assert losses == {
        ("lost", "a scan without ranges"): 1,
        ("lost", "angles are not finite"): 1,
        ("lost", "all beams at one angle"): 1,
        ("lost", "its pose tilts it out of its frame's plane"): 1,
        ("lost", "pose not finite"): 1,
    }


@settings(max_examples=100, deadline=None)
@given(
    x=st.floats(-5, 5), y=st.floats(-5, 5), yaw=st.floats(-3.1, 3.1), upside_down=st.booleans(),
    start=st.floats(-3, 3), end=st.floats(-3, 3).filter(lambda v: abs(v) > 0.01),
)  # fmt: skip
def test_a_scans_own_pose_puts_its_beams_where_they_were(x, y, yaw, upside_down, start, end):
    if start == end:
        return
    half = yaw / 2
    xyzw = (np.cos(half), np.sin(half), 0, 0) if upside_down else (0, 0, np.sin(half), np.cos(half))
    at = pose(x, y, 0.2, xyzw)
    ranges = np.array([1.0, 2.0, 4.0])

    tables, losses = decode("LaserScan", scan(ranges, start, end, at, "base"), topic="/front/scan")

    bearings = np.linspace(start, end, 3)
    ends = np.column_stack([ranges * np.cos(bearings), ranges * np.sin(bearings), np.zeros(3)])
    expected = ends @ se3.rotation_matrix(xyzw).T + [x, y, 0.2]
    columns = tables["scans"].columns
    got = columns["angle_min_rad"][0] + np.arange(3) * columns["angle_increment_rad"][0]
    shift = np.zeros(2)
    if x != 0.0 or y != 0.0:
        edge = tables["transforms"].columns
        assert edge["parent_frame"].tolist() == ["base"]
        assert edge["child_frame"][0] == columns["frame_id"][0] == "front/scan/pose"
        assert edge["rotation_xyzw"].tolist() == [[0, 0, 0, 1]]
        shift = edge["translation_xyz"][0, :2]
    else:
        assert columns["frame_id"][0] == "base"
        assert "transforms" not in tables
    places = np.column_stack([ranges * np.cos(got), ranges * np.sin(got)]) + shift
    np.testing.assert_allclose(places, expected[:, :2], atol=1e-6)
    assert not losses


NUMERIC = {"<u1": 1, "<i1": 2, "<u2": 3, "<i2": 4, "<u4": 5, "<i4": 6, "<f4": 7, "<f8": 8}


def grid(cells, dtype="<i1", name="occupancy", padding=0, before=0, row_padding=0, **values):
    """A Grid of cells (H, W), each with bytes before and behind the number, rows padded too."""
    cells = np.asarray(cells)
    layout = np.dtype(
        [("before", "u1", before), (name, dtype), ("behind", "u1", padding)], align=False
    )
    packed = np.zeros(cells.shape, layout)
    packed[name] = cells
    rows = [row.tobytes() + b"\x07" * row_padding for row in packed]
    return placed(
        pose=pose(-3.0, 2.0, xyzw=(0, 0, 0.6, 0.8)),
        column_count=cells.shape[1],
        cell_size={"x": 0.05, "y": 0.05},
        row_stride=layout.itemsize * cells.shape[1] + row_padding,
        cell_stride=layout.itemsize,
        fields=[{"name": name, "offset": before, "type": NUMERIC[dtype]}],
        data=b"".join(rows),
        **values,
    )


def cells_of(*grids, topic="/map", encoding="json"):
    tables, losses = decode("Grid", *grids, topic=topic, encoding=encoding)
    rows = tables["costmaps"]
    columns = rows.columns
    return [
        columns["cells"][k].reshape(columns["height"][k], columns["width"][k]).tolist()
        for k in range(len(rows))
    ], losses


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.lists(st.integers(-1, 100), min_size=3, max_size=3), min_size=1, max_size=4),
    st.sampled_from(["<i1", "<i2", "<i4"]),
    st.integers(0, 3), st.integers(0, 3), st.integers(0, 3),
    st.sampled_from(["json", "protobuf", "cdr"]),
)  # fmt: skip
def test_cells_are_found_through_any_strides(cells, dtype, padding, before, row_padding, encoding):
    shares = max(map(max, cells)) == 1
    message = grid(cells, dtype, "occupancy", padding, before, row_padding)

    found, losses = cells_of(message, encoding=encoding)

    assert found == [
        (np.where(np.array(cells) == 1, 100, cells) if shares else np.array(cells)).tolist()
    ]
    assert not losses


def test_a_grid_lies_where_its_pose_says():
    tables, _ = decode("Grid", grid([[0, 100]]), topic="/map")

    columns = tables["costmaps"].columns
    np.testing.assert_allclose(columns["origin_xyyaw"], [[-3.0, 2.0, 2 * np.arctan2(0.6, 0.8)]])
    assert columns["resolution_m"].tolist() == [float(np.float32(0.05))]
    assert columns["frame_id"].tolist() == ["map"]


@pytest.mark.parametrize(
    ("dtype", "name", "cells", "expected"),
    [
        ("<u1", "occupancy", [0, 65, 100, 255], [0, 65, 100, -1]),
        ("<u1", "value", [0, 1, 255], [0, 100, -1]),
        ("<i1", "data", [0, 1, -1], [0, 100, -1]),
        ("<u1", "occupancy", [0, 1, 2, 255], [0, 1, 2, -1]),
        ("<u1", "cost", [0, 1, 253, 254, 255], [0, 1, 99, 100, -1]),
        ("<u1", "cost", [0, 1], [0, 1]),
        ("<u1", "occupancy", [0, 128, 254, 255], [0, int(COST_SCALE[128]), 100, -1]),
        ("<f4", "occupancy", [0.0, 0.5, 1.0, np.nan, -1.0], [0, 50, 100, -1, -1]),
        ("<f8", "probability", [0.0, 50.0, 100.0, np.inf, 101.0], [0, 50, 100, -1, -1]),
        ("<i2", "cost", [-1, 0, 100, 300], [-1, 0, 100, -1]),
        ("<u4", "occupancy", [0, 99, 2**32 - 1], [0, 99, -1]),
    ],
)
def test_what_the_numbers_of_a_grid_mean(dtype, name, cells, expected):
    assert cells_of(grid([cells], dtype, name))[0] == [[expected]]


def test_costs_in_one_grid_of_a_topic_make_all_of_them_costs():
    found, _ = cells_of(grid([[0, 50]], "<u1", "layer"), grid([[254, 255]], "<u1", "layer"))
    assert found == [[[0, int(COST_SCALE[50])]], [[100, -1]]]


@pytest.mark.parametrize(
    ("topic", "dtype", "name", "taken"),
    [
        ("/map", "<u1", "drivable_area", True),
        ("/drivable_area", "<u1", "drivable_area", False),
        ("/elevation_map", "<f4", "elevation", False),
        ("/local_costmap", "<i1", "layer0", True),
        ("/anything", "<f4", "occupancy_probability", True),
    ],
)
def test_only_an_occupancy_is_taken(topic, dtype, name, taken):
    tables, losses = decode("Grid", grid([[0, 1]], dtype, name), topic=topic)
    assert len(tables["costmaps"]) == taken
    reason = ("skipped", "none of its fields is an occupancy or a cost")
    assert losses == ({} if taken else {reason: 1})


def test_the_first_occupancy_of_several_fields_is_taken():
    message = grid([[0, 100]], "<u1", "occupancy", padding=1, before=1)
    message["fields"] = [
        {"name": "height", "offset": 0, "type": 1}, *message["fields"],
        {"name": "cost", "offset": 2, "type": 1},
    ]  # fmt: skip
    assert cells_of(message)[0] == [[[0, 100]]]


@pytest.mark.parametrize("has_alpha", [True, False])
def test_painted_maps_are_read_as_map_server_reads_pixels(has_alpha):
    """White is free, black occupied, the grey of unknown cells unknown, and so is what is red."""
    colours = np.array([[254, 254, 254], [0, 0, 0], [205, 205, 205], [112, 137, 134], [255, 0, 0],
                        [0, 0, 0]], dtype=np.uint8)  # fmt: skip
    alpha = np.array([255, 255, 255, 255, 255, 0], dtype=np.uint8)
    message = grid(np.zeros((1, 6)), "<u1", "x", padding=3)
    names = ["blue", "green", "red", *(["alpha"] if has_alpha else [])]
    message["fields"] = [{"name": n, "offset": k, "type": 1} for k, n in enumerate(names)]
    message["data"] = np.column_stack([colours[:, ::-1], alpha]).tobytes()

    assert cells_of(message)[0] == [[[0, 100, -1, -1, -1, -1 if has_alpha else 100]]]


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"row_stride": 1}, "strides, columns and number of bytes do not fit"),
        ({"row_stride": 0}, "strides, columns and number of bytes do not fit"),
        ({"cell_stride": 0, "row_stride": 0}, "strides, columns and number of bytes do not fit"),
        ({"column_count": 0}, "strides, columns and number of bytes do not fit"),
        ({"column_count": 2**32 - 1}, "strides, columns and number of bytes do not fit"),
        ({"data": b""}, "strides, columns and number of bytes do not fit"),
        ({"data": b"\0\0\0"}, "strides, columns and number of bytes do not fit"),
        (
            {"fields": [{"name": "occupancy", "offset": 0, "type": 99}]},
            "strides, columns and number of bytes do not fit",
        ),
        (
            {"fields": [{"name": "occupancy", "offset": 1, "type": 2}]},
            "strides, columns and number of bytes do not fit",
        ),
        ({"cell_size": {"x": 0.0, "y": 0.0}}, "cell size is not positive"),
        ({"cell_size": {"x": 1e300, "y": 1e300}}, "cell size is not positive"),
        ({"cell_size": {"x": 0.05, "y": 0.1}}, "cells are not square"),
        ({"pose": pose(float("nan"))}, "position is not finite"),
    ],
)
def test_grids_that_make_no_sense_are_counted(change, reason):
    found, losses = cells_of(grid([[0, 100], [50, -1]]), {**grid([[0, 100], [50, -1]]), **change})
    assert len(found) == 1
    assert losses == {("lost", reason): 1}


def test_a_field_that_reaches_into_the_next_cell_is_none():
    message = grid([[0, 100], [50, -1]], row_padding=3)
    message["fields"] = [{"name": "occupancy", "offset": 1, "type": 2}]
    found, losses = cells_of(message, grid([[0, 100]]))
    assert found == [[[0, 100]]]
    assert losses == {("lost", "strides, columns and number of bytes do not fit"): 1}


def test_the_last_row_may_come_without_its_padding():
    message = grid([[0, 100], [50, -1]], row_padding=3)
    message["data"] = message["data"][:-3]
    assert cells_of(message)[0] == [[[0, 100], [50, -1]]]


def test_a_grid_without_pose_lies_at_its_frames_origin():
    message = grid([[0, 100]])
    del message["pose"]
    tables, losses = decode("Grid", message, topic="/map", encoding="protobuf")

    assert tables["costmaps"].columns["origin_xyyaw"].tolist() == [[0, 0, 0]]
    assert losses == {("repaired", "origin without orientation taken as not turned"): 1}


def cloud(points, layout, fields=None, **values):
    packed = np.zeros(len(points), np.dtype(layout))
    for k, axis in enumerate("xyz"):
        if axis in packed.dtype.names:
            packed[axis] = np.asarray(points)[:, k]
    found = [
        {"name": n, "offset": packed.dtype.fields[n][1], "type": NUMERIC[f]} for n, f in layout
    ]
    return placed(
        pose=pose(), point_stride=packed.dtype.itemsize, fields=fields or found,
        data=packed.tobytes(), **values,
    )  # fmt: skip


MIXED = [("i", "<u2"), ("z", "<f8"), ("x", "<f4"), ("y", "<i2")]


@pytest.mark.parametrize("encoding", ["json", "protobuf", "cdr"])
def test_a_point_cloud_of_mixed_layout(encoding):
    points = [(1.0, 2.0, 3.0), (np.nan, 0.0, 0.0), (4.0, 5.0, 6.0)]
    tables, losses = decode("PointCloud", cloud(points, MIXED), encoding=encoding)

    assert tables["points"].columns["points_xyz"][0].tolist() == [1, 2, 3, 4, 5, 6]
    assert not losses


def test_a_clouds_own_pose_moves_its_points():
    moved = cloud([(1.0, 2.0, 3.0)], MIXED)
    moved["pose"] = pose(10.0, 0.0, 1.0, (0, 0, 1, 1))
    tables, _ = decode("PointCloud", moved)
    np.testing.assert_allclose(tables["points"].columns["points_xyz"][0], [8, 1, 4], atol=1e-6)


def test_two_axes_are_enough():
    tables, _ = decode("PointCloud", cloud([(1.0, 2.0, 3.0)], [("x", "<f4"), ("y", "<f4")]))
    assert tables["points"].columns["points_xyz"][0].tolist() == [1, 2, 0]


@pytest.mark.parametrize(
    "change",
    [{"point_stride": 0}, {"point_stride": 7}, {"fields": []}, {"data": b"\0"},
     {"data": b"\0" * 17},
     {"fields": [{"name": n, "offset": 0, "type": 77} for n in "xyz"]},
     {"fields": [{"name": n, "offset": 2**32 - 1, "type": 7} for n in "xyz"]}],
)  # fmt: skip
def test_clouds_that_make_no_sense_are_counted(change):
    sound = cloud([(1.0, 2.0, 3.0)], MIXED)
    tables, losses = decode("PointCloud", sound, {**sound, **change})
    assert len(tables["points"]) == 1
    assert losses == {("lost", "no x y z fields, or fewer bytes than said"): 1}


def test_a_location_fix_is_a_nav_sat_fix():
    values = placed(
        "gps", latitude=48.1, longitude=11.5, altitude=520.0, position_covariance_type=2,
        position_covariance=[1.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 3.0],
    )  # fmt: skip
    kind = "sensor_msgs/msg/NavSatFix"
    header = {"stamp": STAMP, "frame_id": "gps"}
    (expected,), _ = read(kind, "json", [to_json({**values, "header": header})])
    nowhere = {**values, "latitude": 0.0, "longitude": 0.0}
    many = {"fixes": [values, {**values, "latitude": 91.0}, nowhere, values]}

    for name, message, rows in (("LocationFix", values, 1), ("LocationFixes", many, 2)):
        tables, losses = decode(name, message, encoding="protobuf")
        got = tables["references"]
        assert len(got) == rows
        for column, value in expected.columns.items():
            np.testing.assert_array_equal(got.columns[column][rows - 1], value[0])
        assert got.t_sensor_ns.tolist() == [T] * rows
        lost = {
            ("lost", "latitude or longitude is none"): 1,
            ("skipped", "the receiver had no fix"): 1,
        }
        assert losses == (lost if rows == 2 else {})


def test_log_lines():
    line = {"timestamp": STAMP, "level": 5, "message": "lost", "name": "amcl"}
    tables, losses = decode("Log", line, {**line, "level": 200}, encoding="protobuf")

    columns = tables["health"].columns
    assert columns["level"].tolist() == [5, 200]  # what an enum does not name stays a number
    assert columns["message"].tolist() == ["lost", "lost"]
    assert columns["name"].tolist() == ["amcl", "amcl"]
    assert not losses
