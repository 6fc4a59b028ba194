"""Points out of PointCloud2 messages of any layout, against a reading byte by byte."""

import struct

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from layered_lidar import cloud_message

from slamreplay.geometry.times import NO_STAMP
from slamreplay.ingest.clouds.fields import clouds_of
from slamreplay.ingest.decoders.decoder import Messages
from slamreplay.ingest.decoders.point_cloud import POINT_CLOUD
from slamreplay.simulate.messages import Messages as Made

STRUCT = {1: "b", 2: "B", 3: "h", 4: "H", 5: "i", 6: "I", 7: "f", 8: "d"}
CUBE = np.array([[[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]], [[7.0, 8.0, 9.0], [-1.0, -2.0, -3.0]]])


@pytest.fixture(scope="module")
def made(type_stores):
    return Made(type_stores[2], 2)


@pytest.fixture(scope="module")
def cloud(made):
    def make(points=CUBE, t_ns=7, frame="/lidar", **layout):
        return cloud_message(made.make, made.header(t_ns, frame), np.asarray(points), **layout)

    return make


def read(*messages):
    return clouds_of(Messages(messages, np.arange(len(messages)), "/points"))


def byte_by_byte(message, name):
    """Values of a field, row by row."""
    field = next(f for f in message.fields if f.name == name)
    form = (">" if message.is_bigendian else "<") + STRUCT[field.datatype]
    raw = bytes(message.data)
    begins = [
        row * message.row_step + column * message.point_step
        for row in range(message.height)
        for column in range(message.width)
    ]
    return [struct.unpack_from(form, raw, begin + field.offset)[0] for begin in begins]


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=60)
@given(
    st.lists(
        st.fixed_dictionaries(
            {
                "big": st.booleans(),
                "pad": st.integers(0, 9),
                "first": st.lists(
                    st.sampled_from([("intensity", "f4"), ("ring", "u2"), ("tag", "u1")]),
                    unique=True,
                ),
                "time": st.sampled_from(
                    [None, ("t", "u4", lambda s: 1e3 * s), ("timestamp", "f8", lambda s: s)]
                ),
                "kind": st.sampled_from(["f4", "f8"]),
            }
        ),
        max_size=5,
    ),
    st.integers(1, 3),
)
def test_any_layouts_are_read_as_byte_by_byte(cloud, layouts, rows):
    late = np.arange(2.0 * rows).reshape(rows, 2)
    points = np.arange(1.0, 1.0 + 6 * rows).reshape(rows, 2, 3)
    messages = [cloud(points, late_s=late, **layout) for layout in layouts]

    clouds = read(*messages)

    assert (len(clouds), clouds.lost) == (len(messages), 0)
    for k, message in enumerate(messages):
        own = slice(*clouds.offsets[k : k + 2])
        for axis, name in enumerate("xyz"):
            assert clouds.xyz[axis, own].tolist() == byte_by_byte(message, name)
        names = [f.name for f in message.fields]
        time = next((name for name in ("t", "timestamp") if name in names), None)
        if time:
            assert clouds.time[own].tolist() == byte_by_byte(message, time)
        elif clouds.time is not None:
            assert np.isnan(clouds.time[own]).all()
    assert clouds.rows.tolist() == [rows] * len(messages)


def test_messages_of_one_layout_and_of_others_keep_their_order(cloud):
    far = cloud(CUBE + 10.0, pad=3)

    clouds = read(cloud(CUBE), cloud(CUBE + 5.0), far, cloud(CUBE + 20.0))

    assert [clouds.xyz[0, k] for k in clouds.offsets[:-1]] == [1.0, 6.0, 11.0, 21.0]
    assert clouds.owner.tolist() == np.repeat(np.arange(4), 4).tolist()
    assert clouds.frame_id.tolist() == ["lidar"] * 4
    assert clouds.t_sensor_ns.tolist() == [7] * 4


def test_zeros_and_what_is_not_finite_are_no_returns(cloud):
    points = np.array([[0.0, 0, 0], [np.inf, 0, 0], [1, np.nan, 2], [0, 0, 0.5]])

    assert np.isfinite(read(cloud(points)).xyz[0]).tolist() == [False, False, False, True]


def test_messages_that_cannot_be_read_are_counted(cloud):
    short, nameless, stepless, vast = (cloud() for _ in range(4))
    short.data = short.data[:-1]
    nameless.fields = nameless.fields[1:]
    stepless.point_step = 4
    vast.height = vast.width = 2**32 - 1

    clouds = read(short, cloud(), nameless, stepless, vast)

    assert (len(clouds), clouds.lost, clouds.index.tolist()) == (1, 4, [1])


def test_an_empty_cloud_is_a_cloud_without_points(cloud):
    empty = cloud(np.empty((0, 2, 3)))

    clouds = read(empty, cloud())

    assert np.diff(clouds.offsets).tolist() == [0, 4]


def test_a_time_beyond_the_point_is_left_out(cloud):
    message = cloud(late_s=np.zeros((2, 2)), time=("time", "f4", lambda s: s))
    message.fields[-1].offset = 14

    clouds = read(message)

    assert (len(clouds), clouds.time) == (1, None)


def test_unstamped_clouds_have_no_stamp(cloud):
    assert read(cloud(t_ns=0)).t_sensor_ns.tolist() == [NO_STAMP]


def test_taken_clouds_are_those_asked_for(cloud):
    clouds = read(cloud(CUBE), cloud(CUBE + 5.0), cloud(CUBE[:1] + 9.0)).take(np.array([2, 0]))

    assert np.diff(clouds.offsets).tolist() == [2, 4]
    assert clouds.xyz[0].tolist() == [10.0, 13.0, 1.0, 4.0, 7.0, -1.0]


def test_points_that_are_kept_are_the_first_in_each_cube(cloud):
    points = [[0.01, 0.02, 0.03], [1, 1, 1], [0.09, 0.02, 0.03], [-0.01, 0.02, 0.03], [9e9, 0, 0]]
    messages = Messages([cloud(points), cloud(points[2:4])], np.arange(2), "/points")

    rows = POINT_CLOUD.decode(messages).columns["points_xyz"]

    np.testing.assert_allclose(rows[0].reshape(-1, 3), np.array(points)[[0, 1, 3, 4]])
    np.testing.assert_allclose(rows[1].reshape(-1, 3), points[2:4])
