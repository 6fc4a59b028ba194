"""JSON and protobuf messages become the same objects as ROS's; broken ones are counted."""

import contextlib
import json

import numpy as np
import pytest
from foxglove_logs import (
    PREFIX,
    TYPES,
    descriptors,
    protobuf_class,
    read,
    to_json,
    to_protobuf,
    to_ros,
)
from google.protobuf import descriptor_pb2
from google.protobuf.message import DecodeError
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.interfaces import Nodetype
from type_store import type_store

from slamreplay.errors import LogError
from slamreplay.ingest.encodings import deserialiser
from slamreplay.ingest.readers.reader import Connection, normalise_type

STORE = type_store()
ROS_TYPES = (
    "sensor_msgs/msg/LaserScan", "nav_msgs/msg/Odometry", "sensor_msgs/msg/Imu",
    "geometry_msgs/msg/PoseWithCovarianceStamped", "tf2_msgs/msg/TFMessage",
    "nav_msgs/msg/OccupancyGrid", "geometry_msgs/msg/PoseArray", "sensor_msgs/msg/NavSatFix",
    "sensor_msgs/msg/PointCloud2", "nav_msgs/msg/Path", "diagnostic_msgs/msg/DiagnosticArray",
)  # fmt: skip


def reader_of(kind, encoding, schema=b""):
    return deserialiser(Connection(0, "/t", kind, encoding, "", "", 1, schema))


def values_of(kind):
    """Any values of a message type, as a dictionary; numbers fit their type."""
    fields = {name: _values(form, args) for name, (form, args) in STORE.fielddefs[kind][1]}
    if kind.startswith("builtin_interfaces"):
        fields = {"sec": st.integers(0, 2**31 - 1), "nanosec": st.integers(0, 10**9 - 1)}
    return st.fixed_dictionaries(fields)


def _values(form, args):
    if form == Nodetype.NAME:
        return values_of(args)
    if form == Nodetype.BASE:
        if args[0] == "byte":
            return st.integers(0, 127)  # rosbags packs it with a sign
        base = args[0]
        if base == "string":
            return st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=5)
        if base == "bool":
            return st.booleans()
        if base.startswith("float"):
            return st.floats(width=int(base[5:]))
        limits = np.iinfo(base)
        return st.integers(int(limits.min), int(limits.max))
    inner, count = args
    if form == Nodetype.SEQUENCE:
        if inner == (Nodetype.BASE, ("uint8", 0)):
            return st.binary(max_size=6)
        return st.lists(_values(*inner), max_size=3)
    return st.lists(_values(*inner), min_size=count, max_size=count)


def flat(value):
    """A message of any make as nested lists and dictionaries of plain values."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, list | tuple):
        return [flat(v) for v in value]
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, bytes):
        return value[0]
    if not hasattr(value, "__dict__"):
        return value
    # rosbags has a type's constants and its name among the fields
    names = [name for name in vars(value) if name.islower() and not name.startswith("__")]
    return {name: flat(getattr(value, name)) for name in names}


def same(one, other):
    return json.dumps(flat(one), sort_keys=True) == json.dumps(flat(other), sort_keys=True)


def through_cdr(kind, values):
    """What rosbags makes of the values after they were recorded."""
    data = STORE.serialize_cdr(to_ros(STORE, kind, values), kind)
    return STORE.deserialize_cdr(bytes(data), kind)


@pytest.mark.parametrize("name", TYPES)
def test_foxglove_messages_are_the_same_in_every_encoding(name):
    kind = PREFIX + name
    read_json, read_proto = reader_of(kind, "json"), reader_of(kind, "protobuf", descriptors(name))

    @settings(max_examples=60, deadline=None)
    @given(values_of(kind))
    def check(values):
        expected = through_cdr(kind, values)
        assert same(read_json(to_json(values)), expected)
        assert same(read_proto(to_protobuf(name, values).SerializeToString()), expected)

    check()
    assert not read_json.missing


@pytest.mark.parametrize("kind", ROS_TYPES)
def test_ros_messages_in_json_are_those_of_cdr(kind):
    read_json = reader_of(kind, "json")

    @settings(max_examples=40, deadline=None)
    @given(values_of(kind), st.sampled_from([("sec", "nanosec"), ("secs", "nsecs")]), st.booleans())
    def check(values, stamp, as_base64):
        payload = to_json(values, stamp=stamp, as_base64=as_base64)
        assert same(read_json(payload), through_cdr(kind, values))

    check()


def test_a_type_of_ros_1_only_is_known_too():
    line = reader_of("rosgraph_msgs/msg/Log", "json")(b'{"level": 8, "msg": "lost"}')
    assert (line.level, line.msg, line.header.stamp.sec) == (8, "lost", 0)


@pytest.mark.parametrize(
    ("given_ranges", "expected"),
    [
        ("[1, null, 2.5]", [1, np.nan, 2.5]),
        ('["NaN", "Infinity", "-Infinity"]', [np.nan, np.inf, -np.inf]),
        ("[NaN, Infinity, -Infinity]", [np.nan, np.inf, -np.inf]),
        ('{"0": 1.5, "1": 2, "2": null}', [1.5, 2, np.nan]),
        ("[1e300]", [np.inf]),
        ("null", []),
    ],
)
def test_numbers_that_json_does_not_have(given_ranges, expected):
    scan = reader_of("sensor_msgs/msg/LaserScan", "json")(f'{{"ranges": {given_ranges}}}'.encode())
    np.testing.assert_array_equal(scan.ranges, np.float32(expected))


def test_a_lone_number_that_is_null_is_no_number():
    scan = reader_of(PREFIX + "LaserScan", "json")(b'{"start_angle": null, "end_angle": "NaN"}')
    assert np.isnan([scan.start_angle, scan.end_angle]).all()


def test_enums_by_name():
    field = reader_of(PREFIX + "PackedElementField", "json")
    assert field(b'{"type": "FLOAT32"}').type == 7
    with pytest.raises(ValueError, match="type: no number"):
        field(b'{"type": "FLOAT31"}')


def test_missing_fields_have_defaults_and_are_counted_when_they_are_asked_for():
    read_json = reader_of("nav_msgs/msg/Odometry", "json")
    for payload in (b"{}", b'{"pose": {"pose": {"position": {"x": 1}}}, "header": null}'):
        message = read_json(payload)
        assert message.pose.pose.position.y == 0.0
        assert message.pose.covariance.tolist() == [0.0] * 36
        assert message.header.stamp.nanosec == 0
    assert read_json.missing == {
        "pose": 1, "header": 2, "pose.pose.position.y": 1, "pose.covariance": 1,
    }  # fmt: skip


def test_a_stamp_without_its_nanoseconds_is_counted():
    read_json = reader_of(PREFIX + "PoseInFrame", "json")
    assert read_json(b'{"timestamp": {"sec": 5}}').timestamp.sec == 5
    assert read_json.missing == {"timestamp.nsec": 1}


@pytest.mark.parametrize(
    ("payload", "reason"),
    [
        (b"[1, 2]", "the message is no JSON object"),
        (b"null", "the message is no JSON object"),
        (b'{"header": 3}', "header is no JSON object"),
        (b'{"header": {"frame_id": 3}}', "header.frame_id: no text"),
        (b'{"header": {"frame_id": "\\ud800"}}', "header.frame_id: .*surrogates"),
        (b'{"header": {"stamp": 5.25}}', "header.stamp: no time"),
        (b'{"header": {"stamp": {"sec": 1e15}}}', "header.stamp: no time"),
        (b'{"header": {"stamp": {"sec": 0, "nsec": -1}}}', "header.stamp: no time"),
        (b'{"header": {"stamp": {"sec": 0.5}}}', "header.stamp: 0.5 is no int64"),
        (b'{"pose": {"covariance": [1, 2]}}', "pose.covariance: 2 numbers, not 36"),
        (b'{"pose": {"covariance": "AAAA"}}', "pose.covariance: no list"),
        (b'{"pose": {"covariance": [[1], [2]]}}', "pose.covariance: no list"),
        (b'{"pose": {"covariance": [{}]}}', "pose.covariance: no list"),
        (b'{"pose": {"pose": {"position": {"x": "east"}}}}', "pose.pose.position.x: no number"),
        (b'{"pose": {"pose": {"position": {"x": [1.0]}}}}', "pose.pose.position.x: no number"),
        (b'{"pose": {"pose": {"position": {"x": 1' + b"0" * 400 + b"}}}}", "position.x: no number"),
        (b"\xff", "codec"),
        (b"[" * 100_000, "nested too deeply"),
    ],
)
def test_json_of_another_kind_is_a_broken_message(payload, reason):
    with pytest.raises(ValueError, match=reason):
        reader_of("nav_msgs/msg/Odometry", "json")(payload)


@pytest.mark.parametrize(
    ("cells", "reason"),
    [(b'"!"', "no base64"), (b"[300]", "no int8"), (b"[0.5]", "no int8"), (b"[null]", "no int8")],
)
def test_cells_that_are_none(cells, reason):
    with pytest.raises(ValueError, match=f"data: .*{reason}"):
        reader_of("nav_msgs/msg/OccupancyGrid", "json")(b'{"data": %s}' % cells)


def full(name):
    """A message with something in every field."""
    stamp = {"sec": 1_700_000_000, "nanosec": 123_456_789}
    pose = {"position": {"x": 1.0, "y": 2.0, "z": 3.0},
            "orientation": {"x": 0.0, "y": 0.0, "z": 0.6, "w": 0.8}}  # fmt: skip
    fields = [{"name": n, "offset": 4 * k, "type": 7} for k, n in enumerate("xyz")]
    placed = {"timestamp": stamp, "frame_id": "map"}
    fix = {**placed, "latitude": 48.1, "longitude": 11.5, "altitude": 520.0,
           "position_covariance": [float(k) for k in range(9)],
           "position_covariance_type": 2}  # fmt: skip
    edge = {"timestamp": stamp, "parent_frame_id": "odom", "child_frame_id": "base_link",
            "translation": pose["position"], "rotation": pose["orientation"]}  # fmt: skip
    return {
        "PoseInFrame": {**placed, "pose": pose},
        "PosesInFrame": {**placed, "poses": [pose, pose]},
        "FrameTransform": edge,
        "FrameTransforms": {"transforms": [edge, {**edge, "child_frame_id": "laser"}]},
        "LaserScan": {**placed, "pose": pose, "start_angle": -1.0, "end_angle": 1.0,
                      "ranges": [1.0, 2.0, 3.0], "intensities": [1.0]},
        "Grid": {**placed, "pose": pose, "column_count": 2, "cell_size": {"x": 0.5, "y": 0.5},
                 "row_stride": 2, "cell_stride": 1,
                 "fields": [{"name": "occupancy", "offset": 0, "type": 2}],
                 "data": bytes([0, 100, 255, 50])},
        "PointCloud": {**placed, "pose": pose, "point_stride": 12, "fields": fields,
                       "data": np.arange(6, dtype="<f4").tobytes()},
        "LocationFix": fix,
        "LocationFixes": {"fixes": [fix, fix]},
        "Odometry": {**placed, "body_frame_id": "base_link", "pose": pose,
                     "linear_velocity": pose["position"], "angular_velocity": pose["position"],
                     "pose_covariance": [0.5] * 36, "velocity_covariance": [0.25] * 36,
                     "metadata": [{"key": "k", "value": "v"}]},
        "Log": {"timestamp": stamp, "level": 4, "message": "lost", "name": "amcl",
                "file": "f", "line": 3},
    }[name]  # fmt: skip


@pytest.mark.parametrize("name", TYPES)
def test_json_that_is_cut_anywhere_is_counted(name):
    payload = to_json(full(name))
    pieces = [payload[:k] for k in range(len(payload))]

    rows, losses = read(PREFIX + name, "json", [payload, *pieces])

    assert {r.messages for r in rows} == {1}
    lost = [count for (kind, reason), count in losses.items() if "cannot be decoded" in reason]
    assert lost == [len(pieces)]


def said(message, kind):
    """What protobuf says is in a message, as nested lists and dictionaries."""
    out = {}
    for name, (form, args) in STORE.fielddefs[kind][1]:
        value = getattr(message, name)
        if form == Nodetype.NAME and args == "builtin_interfaces/msg/Time":
            out[name] = {"sec": value.seconds, "nanosec": value.nanos}
        elif form == Nodetype.NAME:
            out[name] = said(value, args)
        elif form == Nodetype.BASE:
            out[name] = value
        elif args[0][0] == Nodetype.NAME:
            out[name] = [said(element, args[0][1]) for element in value]
        else:
            out[name] = list(value) or [0.0] * (args[1] if form == Nodetype.ARRAY else 0)
    return out


@pytest.mark.parametrize("name", TYPES)
def test_protobuf_that_is_cut_anywhere_is_counted_or_is_what_protobuf_says(name):
    """A cut between two fields leaves a message, of which protobuf itself says what is in it."""
    kind, message = PREFIX + name, protobuf_class(name)
    payload = to_protobuf(name, full(name)).SerializeToString()
    read_proto, whole = reader_of(kind, "protobuf", descriptors(name)), 0
    pieces = [payload[:k] for k in range(len(payload))]
    for piece in pieces:
        try:
            expected = said(message.FromString(piece), kind)
        except DecodeError:
            with pytest.raises(ValueError, match="not a protobuf message"):
                read_proto(piece)
        else:
            whole += 1
            assert flat(read_proto(piece)) == expected

    rows, losses = read(kind, "protobuf", [payload, *pieces], descriptors(name))

    broken = sum(n for (k, reason), n in losses.items() if "cannot be decoded" in reason)
    assert whole > 1
    assert rows[0].messages == 1 + whole
    assert broken == len(pieces) - whole


@pytest.mark.parametrize("name", TYPES)
def test_protobuf_with_any_bytes_changed_never_breaks_down(name):
    kind, schema = PREFIX + name, descriptors(name)
    payload = to_protobuf(name, full(name)).SerializeToString()

    @settings(max_examples=150, deadline=None)
    @given(st.integers(0, len(payload) - 1), st.integers(0, 255), st.binary(max_size=2))
    def check(at, byte, more):
        odd = payload[:at] + bytes([byte]) + more + payload[at + 1 :]
        rows, losses = read(kind, "protobuf", [odd, payload], schema)
        broken = sum(n for (k, reason), n in losses.items() if "cannot be decoded" in reason)
        assert rows[0].messages + broken == 2

    check()


ANYTHING = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=4),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner),
    max_leaves=4,
)


def _paths(value, path=()):
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from [(*path, key), *_paths(inner, (*path, key))]
    elif isinstance(value, list):
        for index, inner in enumerate(value[:2]):
            yield from [(*path, index), *_paths(inner, (*path, index))]


@pytest.mark.parametrize("kind", [*(PREFIX + name for name in TYPES), *ROS_TYPES])
def test_json_with_anything_in_any_field_never_breaks_down(kind):
    name = kind.removeprefix(PREFIX)
    one = st.just(full(name)) if name in TYPES else values_of(kind)

    @settings(max_examples=60, deadline=None)
    @given(one, ANYTHING, st.data())
    def check(values, odd, data):
        payload = to_json(values)
        message = json.loads(payload)
        *parents, last = data.draw(st.sampled_from(list(_paths(message))))
        inner = message
        for step in parents:
            inner = inner[step]
        inner[last] = odd
        rows, losses = read(kind, "json", [json.dumps(message).encode(), payload])
        broken = sum(n for (k, reason), n in losses.items() if "cannot be decoded" in reason)
        assert rows[0].messages + broken == 2

    check()


def _files(name):
    return descriptor_pb2.FileDescriptorSet.FromString(descriptors(name))


def test_descriptors_that_are_cut_or_changed_are_one_clear_error():
    schema = descriptors("LaserScan")
    for k in range(len(schema)):
        with pytest.raises(LogError, match="its protobuf schema"):
            reader_of(PREFIX + "LaserScan", "protobuf", schema[:k])

    @settings(max_examples=200, deadline=None)
    @given(st.integers(0, len(schema) - 1), st.integers(0, 255))
    def check(at, byte):
        odd = schema[:at] + bytes([byte]) + schema[at + 1 :]
        with contextlib.suppress(LogError):  # a changed name or default is no error
            reader_of(PREFIX + "LaserScan", "protobuf", odd)

    check()


def _changed(name, change):
    files = _files(name)
    change({file.name: file for file in files.file}, files)
    return files.SerializeToString()


def _set(file, field, **values):
    def change(files, _whole):
        message = files[file].message_type[0]
        found = next(f for f in message.field if f.name == field)
        for key, value in values.items():
            setattr(found, key, value)

    return change


FIELD = descriptor_pb2.FieldDescriptorProto


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (_set("foxglove/LaserScan.proto", "ranges", type=FIELD.TYPE_STRING), "field at 'ranges'"),
        (_set("foxglove/LaserScan.proto", "ranges", label=FIELD.LABEL_OPTIONAL), "at 'ranges'"),
        (_set("foxglove/LaserScan.proto", "frame_id", type=FIELD.TYPE_BYTES), "at 'frame_id'"),
        (_set("foxglove/LaserScan.proto", "frame_id", label=FIELD.LABEL_REPEATED), "'frame_id'"),
        (_set("foxglove/Vector3.proto", "x", type=FIELD.TYPE_STRING), "at 'pose.position.x'"),
        (
            _set("foxglove/LaserScan.proto", "timestamp", type_name=".foxglove.Pose"),
            "field at 'timestamp'",
        ),
        (
            lambda files, whole: files["foxglove/Pose.proto"].dependency.append(
                "foxglove/LaserScan.proto"
            ),
            "cannot be read",
        ),
        (lambda files, whole: whole.file.remove(files["foxglove/Vector3.proto"]), "cannot be read"),
        (
            lambda files, whole: setattr(
                files["foxglove/LaserScan.proto"].message_type[0], "name", "Other"
            ),
            "Couldn't find message foxglove.LaserScan",
        ),
    ],
)
def test_descriptors_that_mean_something_else_are_refused(change, reason):
    schema = _changed("LaserScan", change)
    with pytest.raises(LogError, match=reason):
        reader_of(PREFIX + "LaserScan", "protobuf", schema)

    rows, losses = read(PREFIX + "LaserScan", "protobuf", [b"", b""], schema)
    assert rows == []
    assert [(kind, count) for (kind, _), count in losses.items()] == [("skipped", 2)]


def test_descriptors_may_lack_fields_and_the_timestamp_file():
    def change(files, whole):
        whole.file.remove(files["google/protobuf/timestamp.proto"])
        message = files["foxglove/LaserScan.proto"].message_type[0]
        message.field.remove(next(f for f in message.field if f.name == "intensities"))

    payload = to_protobuf("LaserScan", full("LaserScan")).SerializeToString()
    scan = reader_of(PREFIX + "LaserScan", "protobuf", _changed("LaserScan", change))(payload)

    assert scan.timestamp.sec == 1_700_000_000
    assert scan.intensities.tolist() == []
    assert scan.ranges.tolist() == [1.0, 2.0, 3.0]


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        ({"position_covariance": [1.0, 2.0]}, "position_covariance: 2 numbers, not 9"),
        ({"timestamp": {"sec": 2**40, "nanosec": 0}}, "timestamp: no time"),
        ({"timestamp": {"sec": 0, "nanosec": -1}}, "timestamp: no time"),
        ({"position_covariance_type": -3}, "position_covariance_type: -3 is no uint8"),
    ],
)
def test_protobuf_values_that_cannot_be_are_broken_messages(values, reason):
    payload = to_protobuf("LocationFix", values).SerializeToString()
    with pytest.raises(ValueError, match=reason):
        reader_of(PREFIX + "LocationFix", "protobuf", descriptors("LocationFix"))(payload)


def test_other_encodings_and_unknown_types_are_named():
    with pytest.raises(LogError, match="encoded as 'flatbuffer'"):
        reader_of(PREFIX + "LaserScan", "flatbuffer")
    with pytest.raises(LogError, match="no definition of this type"):
        reader_of("acme_msgs/msg/Thing", "json")


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("foxglove.LaserScan", "foxglove_msgs/msg/LaserScan"),
        ("foxglove/LaserScan", "foxglove_msgs/msg/LaserScan"),
        ("foxglove_msgs/LaserScan", "foxglove_msgs/msg/LaserScan"),
        ("foxglove_msgs/msg/LaserScan", "foxglove_msgs/msg/LaserScan"),
        ("sensor_msgs/LaserScan", "sensor_msgs/msg/LaserScan"),
        ("foxglove_bridge/Thing", "foxglove_bridge/msg/Thing"),
        ("Thing", "Thing"),
    ],
)
def test_a_type_has_one_name(name, kind):
    assert normalise_type(name) == kind
