"""One set of values as cdr, JSON and protobuf: messages, payloads and whole logs."""

import base64
import importlib
import json
import math
from itertools import accumulate, pairwise

import numpy as np
from mcap.writer import Writer
from mcap_protobuf.schema import build_file_descriptor_set
from rosbags.interfaces import Nodetype

from slamreplay.ingest.readers.reader import Block, Connection
from slamreplay.ingest.reading import read_rows

TYPES = ("PoseInFrame", "PosesInFrame", "FrameTransform", "FrameTransforms", "LaserScan", "Grid",
         "PointCloud", "LocationFix", "LocationFixes", "Odometry", "Log")  # fmt: skip
PREFIX = "foxglove_msgs/msg/"


def protobuf_class(name):
    return getattr(importlib.import_module(f"foxglove_schemas_protobuf.{name}_pb2"), name)


def descriptors(name):
    """The serialised FileDescriptorSet that mcap-protobuf-support writes."""
    return build_file_descriptor_set(protobuf_class(name)).SerializeToString()


def to_protobuf(name, values):
    message = protobuf_class(name)()
    _fill(message, values)
    return message


def _fill(message, values):
    for field, value in values.items():
        target = getattr(message, field)
        if isinstance(value, dict) and "nanosec" in value:
            target.seconds, target.nanos = value["sec"], value["nanosec"]
        elif isinstance(value, dict):
            target.SetInParent()
            _fill(target, value)
        elif isinstance(value, list) and value and isinstance(value[0], dict):
            for element in value:
                _fill(target.add(), element)
        elif isinstance(value, list | np.ndarray):
            target.extend(value)
        else:
            setattr(message, field, value)


def to_json(values, *, stamp=("sec", "nsec"), as_base64=True):
    """A JSON payload; numbers that JSON does not have are texts, bytes are base64 or a list."""
    return json.dumps(_plain(values, stamp, as_base64)).encode()


def _plain(value, stamp, as_base64):
    if isinstance(value, dict) and set(value) == {"sec", "nanosec"}:
        return dict(zip(stamp, (value["sec"], value["nanosec"]), strict=True))
    if isinstance(value, dict):
        return {k: _plain(v, stamp, as_base64) for k, v in value.items()}
    if isinstance(value, bytes):
        return base64.b64encode(value).decode() if as_base64 else list(value)
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, list):
        return [_plain(v, stamp, as_base64) for v in value]
    if isinstance(value, float) and not math.isfinite(value):
        return "NaN" if math.isnan(value) else "Infinity" if value > 0 else "-Infinity"
    return value


def to_ros(store, kind, values):
    """A message object of rosbags; `kind` is a full type name."""
    fields = {}
    for name, (form, args) in store.fielddefs[kind][1]:
        value = values.get(name)
        if form == Nodetype.NAME:
            fields[name] = to_ros(store, args, value or {})
        elif form == Nodetype.BASE:
            zero = "" if args[0] == "string" else False if args[0] == "bool" else 0
            fields[name] = zero if value is None else value
        else:
            (inner, detail), count = args
            value = [] if value is None else value
            if inner == Nodetype.NAME:
                fields[name] = [to_ros(store, detail, v) for v in value]
            elif isinstance(value, bytes):
                fields[name] = np.frombuffer(value, np.dtype(detail[0]))
            else:
                value = value if len(value) else [0] * (count if form == Nodetype.ARRAY else 0)
                fields[name] = np.array(value, dtype=np.dtype(detail[0]))
    return store.types[kind](**fields)


class Payloads:
    """A container in memory with one connection."""

    def __init__(self, kind, encoding, payloads, schema=b"", topic="/topic"):
        self.connections = (Connection(0, topic, kind, encoding, "", "", len(payloads), schema),)
        self.sources, self.losses, self._payloads = (), [], payloads

    def blocks(self, wanted):
        if 0 in wanted:
            ends = [0, *accumulate(len(payload) for payload in self._payloads)]
            found = [(0, a, b, k) for k, (a, b) in enumerate(pairwise(ends))]
            yield Block.of(b"".join(self._payloads), found)


def read(kind, encoding, payloads, schema=b"", topic="/topic"):
    """Rows of all tables, and losses as {(kind, reason without its tail): count}."""
    reader = Payloads(kind, encoding, payloads, schema, topic)
    rows, losses = read_rows([reader], lambda _topic: None, None)
    return rows, {
        (loss.kind, loss.reason.partition(" (first at log time")[0]): loss.count for loss in losses
    }


def write_mcap(path, messages, encoding, *, schema_name="foxglove.{}".format):
    """A log of (topic, name of Foxglove's schema, values, log time in ns)."""
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="", library="test")
        schemas, channels = {}, {}
        for topic, name, values, t_ns in messages:
            if name not in schemas:
                data, form = (b"{}", "jsonschema") if encoding == "json" else (
                    descriptors(name), "protobuf")  # fmt: skip
                schemas[name] = writer.register_schema(schema_name(name), form, data)
            if topic not in channels:
                channels[topic] = writer.register_channel(topic, encoding, schemas[name])
            payload = (
                to_json(values) if encoding == "json"
                else to_protobuf(name, values).SerializeToString()
            )  # fmt: skip
            writer.add_message(channels[topic], t_ns, payload, t_ns)
        writer.finish()
    return path
