"""Damaged logs of every format: one clear line, or what is left with a count of what is lost."""

import os
import shutil
import signal
from contextlib import contextmanager

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from slamreplay.errors import LogError, UsageError
from slamreplay.ingest.pipeline import ingest

# A damaged number may be as large as numbers get.
pytestmark = pytest.mark.filterwarnings("default:overflow encountered:RuntimeWarning")

SECOND = 10**9
EPOCH = 1_700_000_000 * SECOND
ODOM, SCAN, TF = "nav_msgs/msg/Odometry", "sensor_msgs/msg/LaserScan", "tf2_msgs/msg/TFMessage"
PATIENCE_S = 60  # for a log of a few kilobytes: a length that is damaged must not stop anybody
#: The same few examples every time, unless a number of random ones is asked for.
EXAMPLES = int(os.environ.get("SLAMREPLAY_FUZZ", "0"))


def messages(logs, ros=2):
    """A second and a half of a small robot: (topic, type, message, log time)."""
    out = []
    for step in range(15):
        t_ns = EPOCH + step * SECOND // 10
        stamp = {"header__stamp__sec": t_ns // SECOND, "header__stamp__nanosec": t_ns % SECOND}
        odometry = logs.make(
            ODOM, ros, **stamp, header__frame_id="odom", child_frame_id="base_link",
            pose__pose__position__x=0.1 * step, pose__pose__orientation__w=1.0,
        )  # fmt: skip
        scan = logs.make(
            SCAN, ros, **stamp, header__frame_id="base_link", angle_min=-1.0, angle_increment=0.01,
            range_min=0.1, range_max=9.0, ranges=np.full(200, 2.0 + 0.1 * step, np.float32),
        )  # fmt: skip
        edge = logs.make(
            "geometry_msgs/msg/TransformStamped", ros, **stamp, header__frame_id="odom",
            child_frame_id="base_link", transform__translation__x=0.1 * step,
            transform__rotation__w=1.0,
        )  # fmt: skip
        out += [
            ("/odom", ODOM, odometry, t_ns),
            ("/scan", SCAN, scan, t_ns),
            ("/tf", TF, logs.make(TF, ros, transforms=[edge]), t_ns),
        ]
    return out


def bag(logs, compression=None):
    from rosbags.rosbag1 import Writer

    path, store = logs.folder / "log.bag", logs.stores[1]
    writer = Writer(path)
    writer.chunk_threshold = 4000
    if compression:
        writer.set_compression(Writer.CompressionFormat[compression])
    with writer:
        connections = {}
        for topic, kind, message, t_ns in messages(logs, ros=1):
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(connections[topic], t_ns, store.serialize_ros1(message, kind))
    return path


def mcap(logs, compression="NONE", *, chunked=True):
    from mcap.writer import CompressionType, Writer

    path, store = logs.folder / "log.mcap", logs.stores[2]
    with path.open("wb") as stream:
        writer = Writer(
            stream, chunk_size=4000, compression=CompressionType[compression], use_chunking=chunked
        )
        writer.start(profile="ros2", library="")
        channels = {}
        for topic, kind, message, t_ns in messages(logs):
            if topic not in channels:
                text = store.generate_msgdef(kind, ros_version=2)[0].encode()
                schema = writer.register_schema(kind, "ros2msg", text)
                channels[topic] = writer.register_channel(topic, "cdr", schema)
            data = bytes(store.serialize_cdr(message, kind))
            writer.add_message(channels[topic], log_time=t_ns, publish_time=t_ns, data=data)
        writer.finish()
    return path


def folder(logs, storage, mode=None):
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

    path, store = logs.folder / "log", logs.stores[2]
    writer = Writer(path, version=9, storage_plugin=StoragePlugin[storage])
    if mode:
        writer.set_compression(CompressionMode[mode], CompressionFormat.ZSTD)
    with writer:
        connections = {}
        for topic, kind, message, t_ns in messages(logs):
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(connections[topic], t_ns, store.serialize_cdr(message, kind))
    return path


LOGS = {
    "bag": bag,
    "bag-lz4": lambda logs: bag(logs, "LZ4"),
    "bag-bz2": lambda logs: bag(logs, "BZ2"),
    "mcap": mcap,
    "mcap-zstd": lambda logs: mcap(logs, "ZSTD"),
    "mcap-lz4": lambda logs: mcap(logs, "LZ4"),
    "mcap-unchunked": lambda logs: mcap(logs, chunked=False),
    "db3": lambda logs: logs.write("log.db3", messages(logs)),
    "folder-db3": lambda logs: folder(logs, "SQLITE3"),
    "folder-mcap": lambda logs: folder(logs, "MCAP"),
    "folder-file-zstd": lambda logs: folder(logs, "SQLITE3", "FILE"),
    "folder-message-zstd": lambda logs: folder(logs, "SQLITE3", "MESSAGE"),
}


class Log:
    """A small log whose storage file is damaged again and again.

    Attributes:
        path: what is ingested.
        file: the storage file in it, or the path itself.
        metadata: metadata.yaml beside it, None without.
        content: the bytes of the file while it was whole.
        rows: rows of the tables while it was whole.
    """

    def __init__(self, path):
        self.path = path
        inner = sorted(p for p in path.iterdir() if p.suffix != ".yaml") if path.is_dir() else []
        self.file = inner[0] if inner else path
        self.metadata = path / "metadata.yaml" if inner else None
        self.content = self.file.read_bytes()
        bundle = self.ingested()
        self.rows = rows_of(bundle)
        assert not bundle.manifest.losses

    def __repr__(self):
        return self.path.name

    def ingested(self):
        """The bundle; None where the log is refused in one line and nothing stays behind."""
        target = self.path.parent / "out" / "bundle"
        shutil.rmtree(target.parent, ignore_errors=True)
        try:
            with patience():
                return ingest([self.path], target)
        except (LogError, UsageError) as error:
            line = str(error)
        assert "\n" not in line
        assert len(line) < 500
        assert not target.exists()
        return None

    def check(self, *, twice=False):
        """Ingest the damaged log: what is gone is counted. Some of it may be there `twice`."""
        bundle = self.ingested()
        if bundle is None:
            return
        rows = rows_of(bundle)
        assert set(rows) <= set(self.rows)
        assert twice or all(rows[table] <= self.rows[table] for table in rows)
        gone = {table: self.rows[table] - rows.get(table, 0) for table in self.rows}
        gone = {table: count for table, count in gone.items() if count > 0}
        assert bundle.manifest.losses or not gone, f"{gone} rows are gone without a word"


def rows_of(bundle):
    return {name: entry.rows for name, entry in bundle.manifest.tables.items()}


@contextmanager
def patience():
    def stop(*_):
        raise TimeoutError(f"not read after {PATIENCE_S} s")

    before = signal.signal(signal.SIGALRM, stop)
    signal.alarm(PATIENCE_S)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


@pytest.fixture(params=LOGS)
def log(request, logs):
    return Log(LOGS[request.param](logs))


@pytest.fixture(params=["folder-db3", "folder-file-zstd", "folder-message-zstd"])
def with_metadata(request, logs):
    return Log(LOGS[request.param](logs))


fuzz = settings(
    deadline=None,
    max_examples=EXAMPLES or 12,
    derandomize=not EXAMPLES,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
places = st.floats(0, 1, exclude_max=True)


@fuzz
@given(share=places)
def test_cut(log, share):
    log.file.write_bytes(log.content[: int(share * len(log.content))])
    log.check()


@fuzz
@given(flips=st.lists(st.tuples(places, st.integers(1, 255)), min_size=1, max_size=6))
def test_flipped_bytes(log, flips):
    content = bytearray(log.content)
    for share, flip in flips:
        content[int(share * len(content))] ^= flip
    log.file.write_bytes(content)
    log.check()


@fuzz
@given(share=places, size=st.sampled_from([1, 8, 100, 512, 4096]), fill=st.sampled_from([0, 255]))
def test_a_block_overwritten(log, share, size, fill):
    at = int(share * len(log.content))
    size = min(size, len(log.content) - at)
    content = log.content[:at] + bytes([fill]) * size + log.content[at + size :]
    log.file.write_bytes(content)
    log.check()


@fuzz
@given(share=places, size=st.integers(1, 5000), times=st.sampled_from([0, 2]))
def test_a_block_left_out_or_written_twice(log, share, size, times):
    at = int(share * len(log.content))
    content = log.content[:at] + log.content[at : at + size] * times + log.content[at + size :]
    log.file.write_bytes(content)
    # Bags and MCAP files do not number their messages: a record that is there twice is two.
    log.check(twice=times == 2 and log.file.suffix in {".bag", ".mcap"})


@fuzz
@given(noise=st.binary(max_size=200), share=places)
def test_noise_behind_any_beginning(log, noise, share):
    log.file.write_bytes(log.content[: int(share * 200)] + noise)
    log.check()


@fuzz
@given(share=places, flip=st.integers(0, 255), cut=st.booleans())
def test_damaged_metadata(with_metadata, share, flip, cut):
    log = with_metadata
    content = bytearray(log.metadata.read_bytes())
    whole = bytes(content)
    at = int(share * len(content))
    content[at] ^= flip
    log.metadata.write_bytes(content[:at] if cut else content)
    log.check()
    log.metadata.write_bytes(whole)


KEYS = ["relative_file_paths", "compression_format", "compression_mode", "files", "message_count",
        "topics_with_message_count", "storage_identifier", "version"]  # fmt: skip
ODD = [None, True, 0, -1, 1.5, "zstd", "message", "file", ".", "../log", "/", "a\0b", "x" * 5000,
       "", [], [None], [3], [["a"]], ["."], ["metadata.yaml"], ["x" * 5000], ["a\0b"], {}, {"a": 1},
       [{"a": 1}]]  # fmt: skip


def test_odd_values_in_metadata(with_metadata):
    import yaml

    log, wrong = with_metadata, []
    meta = yaml.safe_load(log.metadata.read_text())
    for key in KEYS:
        for value in ODD:
            changed = meta["rosbag2_bagfile_information"] | {key: value}
            log.metadata.write_text(yaml.safe_dump({"rosbag2_bagfile_information": changed}))
            try:
                log.check()
            except Exception as error:  # all of them are to be seen at once
                wrong.append(f"{key}: {value!r:.30}: {error!r:.60}")
    assert wrong == []


OTHERS = ["", "null", "[]", "3", "a: &a [*a]", "\t", "\0", "!!python/x y", "? {a: b}\n: c",
          "a: 2001-99-99", "[" * 3000, "rosbag2_bagfile_information:",
          "rosbag2_bagfile_information: [1]"]  # fmt: skip


@pytest.mark.parametrize("text", OTHERS, ids=range(len(OTHERS)))
def test_metadata_that_is_something_else(with_metadata, text):
    with_metadata.metadata.write_text(text)
    with_metadata.check()
