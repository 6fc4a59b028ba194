"""Columns read from bytes are what rosbags reads message by message, for every type we decode."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.interfaces import Nodetype
from rosbags.typesys import get_types_from_msg
from type_store import type_store

from slamreplay.ingest import DECODERS
from slamreplay.ingest.wire.layout import Number, Struct, Text, layout_of
from slamreplay.ingest.wire.read import read_messages
from slamreplay.messages.interfaces import as_message

#: Layouts that alignment makes awkward: what real types have only here and there, all at once.
ODD = {
    "odd/msg/Small": "uint8 a\nfloat64 b\nuint8 c\n",
    "odd/msg/Tail": "float64 b\nfloat32 c\n",
    "odd/msg/Word": "string w\nuint8 n\n",
    "odd/msg/Nested": "odd/Word[] words\nfloat64 x\nodd/Small[] small\n",
    "odd/msg/All": (
        "uint8 first\nstring name\nfloat64[] numbers\nodd/Small[] small\nodd/Tail[] tail\n"
        "uint16 middle\nodd/Word[] words\nodd/Nested[] nested\nstring[] names\nfloat32[3] three\n"
        "odd/Tail[2] pair\nint8[] bytes\nint64 last\n"
    ),
}
NAMES = sorted(as_message(n) for n in {*DECODERS, "odd/msg/All"} if not n.startswith("foxglove"))


def store(ros, *, later=False):
    found = type_store(ros, later=later)
    for name, text in ODD.items():
        if name not in found.fielddefs:
            found.register(get_types_from_msg(text, name))
    return found


_RANGES = {f"{u}int{b}": (0 if u else -(2 ** (b - 1)), 2 ** (b - (not u)) - 1)
           for u in ("", "u") for b in (8, 16, 32, 64)}  # fmt: skip
_RANGES |= {"byte": (0, 127), "char": (0, 127), "bool": (0, 1)}


def random_value(node, types, rng, most):
    kind, args = node
    if kind == Nodetype.NAME:
        return random_message(args, types, rng, most)
    if kind == Nodetype.BASE:
        name = args[0]
        if name == "string":
            return "".join(rng.choice(list("abcé/_ "), size=rng.integers(0, 7)))
        if name.startswith("float"):
            value = rng.choice([rng.normal(), np.nan, np.inf, 0.0])
            return float(np.float32(value)) if name == "float32" else float(value)
        low, high = _RANGES[name]
        return (
            bool(rng.integers(2))
            if name == "bool"
            else int(
                rng.integers(low, high, endpoint=True, dtype=np.uint64 if low == 0 else np.int64)
            )
        )
    inner, size = args
    count = size if kind == Nodetype.ARRAY else int(rng.integers(0, most + 1))
    values = [random_value(inner, types, rng, most) for _ in range(count)]
    if inner[0] == Nodetype.BASE and inner[1][0] != "string":
        kind = inner[1][0].replace("byte", "uint8").replace("char", "uint8")
        return np.array(values, dtype=kind)
    return values


def random_message(name, types, rng, most=3):
    fields = {f: random_value(n, types, rng, most) for f, n in types.fielddefs[name][1]}
    return types.types[name](**fields)


def serialise(types, name, message, encoding):
    if encoding == "ros1":
        return bytes(types.serialize_ros1(message, name))
    return bytes(types.serialize_cdr(message, name, little_endian=encoding == "cdr_le"))


def read(payloads, layouts, encoding):
    data = np.frombuffer(b"".join(payloads), dtype=np.uint8)
    end = np.cumsum([len(p) for p in payloads]).astype(np.int64)
    start = end - [len(p) for p in payloads]
    t_log = np.arange(len(payloads), dtype=np.int64)
    kind = "ros1" if encoding == "ros1" else "cdr"
    return list(read_messages(data, start, end, t_log, "/topic", layouts, kind))


def assert_same(messages, items, node, path=""):
    """Every field of every message, down to the last number."""
    for name, field in node.fields.items():
        at = f"{path}.{name}" if path else name
        assert_same_field(messages, [getattr(m, name) for m in items], field, at)


def assert_same_field(messages, values, node, at):
    if isinstance(node, Struct):
        for name, field in node.fields.items():
            inner = f"{at}.{name}" if at else name
            assert_same_field(messages, [getattr(v, name) for v in values], field, inner)
    elif isinstance(node, Number):
        got = messages.column(at, object)
        np.testing.assert_array_equal(
            np.array(got.tolist()), np.array(values, dtype=got.dtype).tolist()
        )
    elif isinstance(node, Text):
        assert messages.texts(at).tolist() == list(values)
    elif isinstance(node.element, Number):
        ragged = messages.ragged(at, np.dtype(node.element.dtype))
        assert len(ragged) == len(values)
        for row, value in enumerate(values):
            np.testing.assert_array_equal(
                ragged[row], np.asarray(value).astype(ragged.values.dtype)
            )
        if node.count:
            # rosbags has ROS 2's byte, an octet, as a signed number.
            kind = np.dtype(node.element.dtype)
            rows = np.array(values).astype(kind).reshape(-1, node.count).astype(np.float64)
            np.testing.assert_array_equal(messages.fixed(at, node.count), rows)
    else:
        children, rows = messages.children(at)
        assert rows.tolist() == [k for k, v in enumerate(values) for _ in v]
        if isinstance(node.element, Text):
            ragged = messages.ragged(at, object)
            assert [list(ragged[k]) for k in range(len(values))] == [list(v) for v in values]
        assert_same_field(children, [e for v in values for e in v], node.element, "")


@pytest.mark.parametrize("encoding", ["ros1", "cdr_le", "cdr_be"])
@pytest.mark.parametrize("name", NAMES)
def test_every_field_of_every_type_is_what_rosbags_reads(name, encoding):
    types = store(1 if encoding == "ros1" else 2)
    if name not in types.fielddefs:
        pytest.skip("the other ROS has this type")
    layout = layout_of(name, types.fielddefs, encoding[:4].rstrip("_"))
    rng = np.random.default_rng(3)
    for most in (0, 1, 3, 9):
        items = [random_message(name, types, rng, most) for _ in range(7)]
        payloads = [serialise(types, name, m, encoding) for m in items]
        ((messages, index),) = read(payloads, [layout], encoding)
        assert index.tolist() == list(range(7))
        assert_same(messages, items, layout)
        some = np.arange(7) % 3 == 0
        assert_same(messages.take(some), [m for m, s in zip(items, some, strict=True) if s], layout)
    alike = [items[0]] * 5  # what a topic mostly is: one layout throughout
    ((messages, _),) = read(
        [serialise(types, name, m, encoding) for m in alike], [layout], encoding
    )
    assert_same(messages, alike, layout)


@settings(deadline=None, max_examples=60)
@given(seed=st.integers(0, 2**32), most=st.integers(0, 6), count=st.integers(1, 12),
       encoding=st.sampled_from(["ros1", "cdr_le", "cdr_be"]))  # fmt: skip
def test_awkward_layouts_are_read_like_rosbags(seed, most, count, encoding):
    types = store(1 if encoding == "ros1" else 2)
    rng = np.random.default_rng(seed)
    layout = layout_of("odd/msg/All", types.fielddefs)
    items = [random_message("odd/msg/All", types, rng, most) for _ in range(count)]
    payloads = [serialise(types, "odd/msg/All", m, encoding) for m in items]
    ((messages, index),) = read(payloads, [layout], encoding)
    assert len(index) == count
    assert_same(messages, items, layout)


@pytest.mark.parametrize("encoding", ["ros1", "cdr_le"])
@pytest.mark.parametrize("name", NAMES)
def test_a_message_cut_at_any_byte_is_left_out_and_its_neighbours_are_not(name, encoding):
    types = store(1 if encoding == "ros1" else 2)
    if name not in types.fielddefs:
        pytest.skip("the other ROS has this type")
    layout = layout_of(name, types.fielddefs, encoding[:4].rstrip("_"))
    rng = np.random.default_rng(11)
    items = [random_message(name, types, rng, 2) for _ in range(2)]
    before, whole = (serialise(types, name, m, encoding) for m in items)
    deserialise = types.deserialize_ros1 if encoding == "ros1" else types.deserialize_cdr
    for cut in range(len(whole)):
        try:
            deserialise(whole[:cut], name)
            is_sound = True  # what is missing is padding
        except Exception:
            is_sound = False
        found = read([before, whole[:cut], before], [layout], encoding)
        kept = sorted(int(i) for _, index in found for i in index)
        assert kept == ([0, 1, 2] if is_sound else [0, 2]), cut


def test_flipped_bytes_never_upset_the_walk_nor_the_neighbours():
    types = store(2)
    layout = layout_of("odd/msg/All", types.fielddefs)
    rng = np.random.default_rng(5)
    whole = serialise(types, "odd/msg/All", random_message("odd/msg/All", types, rng, 4), "cdr_le")
    for _ in range(600):
        broken = bytearray(whole)
        broken[rng.integers(4, len(whole))] = rng.integers(256)
        ((messages, index),) = read([whole, bytes(broken), whole], [layout], "cdr_le")
        assert {0, 2} <= set(index.tolist())
        messages.children("nested")[0].children("words")[0].texts("w")


def test_of_two_layouts_the_one_that_fits_is_read():
    name = "nav2_msgs/msg/BehaviorTreeLog"
    old, new = store(2), store(2, later=True)
    layouts = [layout_of(name, types.fielddefs) for types in (old, new)]
    rng = np.random.default_rng(1)
    for types, layout in zip((old, new), layouts, strict=True):
        items = [random_message(name, types, rng, 4) for _ in range(9)]
        ((messages, _),) = read(
            [serialise(types, name, m, "cdr_le") for m in items], layouts, "cdr"
        )
        assert_same(messages, items, layout)


def test_byte_orders_may_be_mixed():
    types = store(2)
    layout = layout_of("geometry_msgs/msg/TwistStamped", types.fielddefs)
    rng = np.random.default_rng(1)
    items = [random_message("geometry_msgs/msg/TwistStamped", types, rng) for _ in range(4)]
    payloads = [serialise(types, "geometry_msgs/msg/TwistStamped", m, f"cdr_{e}")
                for m, e in zip(items, ["le", "be", "le", "be"], strict=True)]  # fmt: skip
    for messages, index in read(payloads, [layout], "cdr"):
        assert_same(messages, [items[i] for i in index], layout)
