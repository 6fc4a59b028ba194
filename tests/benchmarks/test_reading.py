"""Reading logs into columns beside rosbags and mcap, in the same run: ratios, whatever the machine.

Run with: uv run pytest tests/benchmarks/test_reading.py --benchmark-only
As a table with the goals beside it: uv run python tests/benchmarks/test_reading.py
"""

import os
import statistics
import sys
import time
from pathlib import Path
from tempfile import gettempdir

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
import field_log

from slamreplay.bundle.manifest import Source
from slamreplay.ingest.readers.mcap_file import McapReader
from slamreplay.ingest.readers.ros1 import Ros1Reader
from slamreplay.ingest.readers.sqlite_file import SqliteReader
from slamreplay.ingest.reading import read_rows

READERS = {".mcap": McapReader, ".bag": Ros1Reader, ".db3": SqliteReader}

SECONDS = int(os.environ.get("SLAMREPLAY_BENCH_SECONDS", "120"))
FOLDER = Path(os.environ.get("SLAMREPLAY_BENCH_LOGS", gettempdir())) / "slamreplay_reading"
#: Log, how it is written, peer, goal, and below what it fails: times faster than the peer.
CASES = [
    ("none.mcap", {}, "rosbags", 10.0, 7.0),
    ("none.bag", {}, "rosbags", 10.0, 7.0),
    ("zstd.mcap", {"compression": "zstd"}, "rosbags", 6.0, 4.0),
    ("camera.mcap", {"compression": "zstd", "camera": True}, "rosbags", 4.5, 3.5),
    ("lz4.mcap", {"compression": "lz4"}, "rosbags", 7.0, 4.5),
    ("lz4.bag", {"compression": "lz4"}, "rosbags", 7.0, 4.5),
    ("bz2.bag", {"compression": "bz2"}, "rosbags", None, None),
    ("log.db3", {}, "rosbags", 4.5, 3.5),
    ("zstd.mcap", {"compression": "zstd"}, "mcap", 25.0, 15.0),
]


def _stamp(m):
    return m.header.stamp.sec * 10**9 + m.header.stamp.nanosec


def _xyz(v):
    return (v.x, v.y, v.z)


def _xyzw(q):
    return (q.x, q.y, q.z, q.w)


def _odometry(m):
    pose, twist = m.pose.pose, m.twist.twist
    return (_stamp(m), m.header.frame_id, m.child_frame_id, _xyz(pose.position),
            _xyzw(pose.orientation), m.pose.covariance, _xyz(twist.linear), _xyz(twist.angular),
            m.twist.covariance)  # fmt: skip


def _imu(m):
    return (_stamp(m), m.header.frame_id, _xyzw(m.orientation), m.orientation_covariance,
            _xyz(m.angular_velocity), m.angular_velocity_covariance,
            _xyz(m.linear_acceleration), m.linear_acceleration_covariance)  # fmt: skip


def _scan(m):
    return (_stamp(m), m.header.frame_id, m.angle_min, m.angle_increment, m.time_increment,
            m.scan_time, m.range_min, m.range_max, m.ranges)  # fmt: skip


def _tf(m):
    return [(_stamp(t), t.header.frame_id, t.child_frame_id, _xyz(t.transform.translation),
             _xyzw(t.transform.rotation)) for t in m.transforms]  # fmt: skip


def _grid(m):
    origin = m.info.origin
    return (_stamp(m), m.header.frame_id, m.info.resolution, m.info.width, m.info.height,
            _xyz(origin.position), _xyzw(origin.orientation), m.data)  # fmt: skip


def _tree(m):
    return [(m.timestamp.sec * 10**9 + m.timestamp.nanosec, e.node_name, e.current_status)
            for e in m.event_log]  # fmt: skip


def _joints(m):
    values = zip(m.name, m.position, m.velocity, strict=True)
    return [(_stamp(m), name, position, velocity) for name, position, velocity in values]


#: Type to (how its fields are picked, whether a message gives several rows, ragged last column).
PICK = {
    field_log.ODOM: (_odometry, False, False),
    field_log.IMU: (_imu, False, False),
    field_log.SCAN: (_scan, False, True),
    field_log.TF: (_tf, True, False),
    field_log.GRID: (_grid, False, True),
    field_log.TREE: (_tree, True, False),
    field_log.JOINTS: (_joints, True, False),
}


def _columns(kind, rows):
    _, _, ragged = PICK[kind]
    columns = list(zip(*rows, strict=True))
    if ragged:
        columns[-1] = [np.concatenate(columns[-1])]
    return [
        np.array(c) if not isinstance(c[0], str) else np.array(c, dtype=object) for c in columns
    ]


def _gather(stream):
    rows, times = {}, {}
    for topic, kind, t, message in stream:
        pick, several, _ = PICK[kind]
        picked = pick(message)
        rows.setdefault((topic, kind), []).extend(picked if several else [picked])
        times.setdefault(topic, []).append(t)
    found = {key: _columns(key[1], value) for key, value in rows.items()}
    return found, {topic: np.array(t) for topic, t in times.items()}


def with_rosbags(path):
    """The same columns through rosbags' AnyReader."""
    from rosbags.highlevel import AnyReader

    with AnyReader([path], default_typestore=field_log.store(2)) as reader:
        wanted = [c for c in reader.connections if c.msgtype in PICK]
        return _gather(
            (c.topic, c.msgtype, t, reader.deserialize(data, c.msgtype))
            for c, t, data in reader.messages(wanted)
        )


def with_mcap(path):
    """The same columns through mcap and mcap-ros2-support."""
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    with path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()], validate_crcs=True)
        topics = [c.topic for c in reader.get_summary().channels.values()
                  if reader.get_summary().schemas[c.schema_id].name in PICK]  # fmt: skip
        return _gather(
            (channel.topic, schema.name, message.log_time, decoded)
            for schema, channel, message, decoded in reader.iter_decoded_messages(topics)
        )


def with_slamreplay(path):
    """Our columns; the file's hash, which the bundle needs, is not part of it."""
    reader = READERS[path.suffix](path, Source(name=path.name, format="", bytes=0, sha256=""))
    return read_rows([reader], lambda _: None, None)


PEERS = {"rosbags": with_rosbags, "mcap": with_mcap}


def ratios(path, peer, runs=5):
    """CPU seconds of the peer over ours, and both, paired A B A B; the file is read beforehand."""
    path.read_bytes()
    with_slamreplay(path)
    own, theirs = [], []
    for _ in range(runs):
        for work, found in ((PEERS[peer], theirs), (with_slamreplay, own)):
            wall, cpu = time.perf_counter(), time.process_time()
            work(path)
            found.append((time.process_time() - cpu, time.perf_counter() - wall))
    cpu = statistics.median(b[0] / a[0] for a, b in zip(own, theirs, strict=True))
    wall = statistics.median(b[1] / a[1] for a, b in zip(own, theirs, strict=True))
    return cpu, wall, statistics.median(a[0] for a in own), statistics.median(b[0] for b in theirs)


def log_of(name, how, seconds=SECONDS):
    FOLDER.mkdir(exist_ok=True, parents=True)
    return field_log.write(FOLDER / f"{seconds}_{name}", seconds, **how)


@pytest.mark.parametrize(("name", "how", "peer", "goal", "least"), CASES)
def test_reading(benchmark, name, how, peer, goal, least):
    """`extra_info` holds how many times less CPU and wall time than the peer, and the goal."""
    if peer == "mcap":
        pytest.importorskip("mcap_ros2", reason="mcap-ros2-support is not installed")
    path = log_of(name, how)
    cpu, wall, _, _ = ratios(path, peer)
    benchmark.pedantic(with_slamreplay, (path,), rounds=3)
    benchmark.extra_info |= {"peer": peer, "cpu_ratio": cpu, "wall_ratio": wall, "goal": goal}
    assert least is None or cpu > least


def main():
    print("| log | against | goal | fails below | CPU ratio | wall ratio | CPU s | peer's |")
    print("|---|---|---|---|---|---|---|---|")
    for name, how, peer, goal, least in CASES:
        path = log_of(name, how)
        cpu, wall, own, theirs = ratios(path, peer)
        numbers = f"{cpu:.1f} | {wall:.1f} | {own:.2f} | {theirs:.2f}"
        print(f"| {name} | {peer} | {goal} | {least} | {numbers} |", flush=True)


if __name__ == "__main__":
    main()
