"""Recordings as log files: the one place of the simulator that knows rosbags and mcap.

The same records give the same bytes: no file holds when or where it was written. A log is written
under a temporary name and renamed, so that it is whole or absent.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from types import MappingProxyType
from typing import Any

from rosbags.interfaces import (
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from slamreplay.bundle.atomic import atomic_folder, check_target
from slamreplay.errors import OutputError
from slamreplay.ingest.labels import RECORD as LABELS_RECORD
from slamreplay.messages.definitions import DEFINITIONS, LATER_DEFINITIONS
from slamreplay.simulate.messages import Messages
from slamreplay.simulate.topics import LATCHED, Record

#: rosbag2's own file inside a folder, by which a log folder is known.
FOLDER_MARKER = "metadata.yaml"
#: Larger chunks than recorders use: a sample log compresses better so.
_CHUNK_BYTES = 4 << 20
_LIBRARY = "slamreplay simulate"
_NO_LABELS: Mapping[str, str] = MappingProxyType({})
#: rosbag2 writes policies of its quality of service as numbers up to version 8 of its metadata and
#: as words since; each release before Jazzy reads numbers only. By a record without a version the
#: later ones know that it is numbers they find (rosbag2_storage_mcap, mcap_storage.cpp).
_BAG_METADATA = {"serialized_metadata": ""}


def write_log(
    target: Path,
    make: Callable[[Messages], Sequence[Record]],
    *,
    labels: Mapping[str, str] = _NO_LABELS,
) -> None:
    """Write a log; its suffix says which kind.

    Args:
        target: `.mcap` (ROS 2, zstd chunks), `.db3` (ROS 2, SQLite), `.bag` (ROS 1), or no suffix
            for a rosbag2 folder with an mcap file.
        make: gives the records, sorted by time, from the message classes of that kind.
        labels: site, robot and the like: a metadata record of MCAP, `custom_data` of rosbag2.

    Raises:
        OutputError: another suffix, labels in a ROS 1 bag, or a place that cannot be written.
    """
    check_labels(target, labels)
    if target.suffix not in _FILES:
        if target.suffix:
            raise OutputError(
                f"'{target.suffix}' is no kind of log",
                where=target,
                hint="use .mcap, .db3, .bag, or no suffix for a rosbag2 folder",
            )
        check_target(target, FOLDER_MARKER)
        store = type_store(2)
        log = make(Messages(store, 2))
        with atomic_folder(target, marker=FOLDER_MARKER) as work, _scratch(target) as scratch:
            _write_rosbag2(scratch / target.name, store, log, "mcap", labels)
            for file in sorted((scratch / target.name).iterdir()):
                file.rename(work / file.name)
        return
    if target.is_dir():
        raise OutputError("is a folder", where=target, hint="name another output with -o")
    ros_version, write = _FILES[target.suffix]
    store = type_store(ros_version)
    try:
        with _scratch(target) as scratch:
            log = make(Messages(store, ros_version))
            write(scratch / target.stem, store, log, labels).replace(target)
    except OSError as error:
        raise OutputError(f"cannot write: {error.strerror or error}", where=target) from error


def check_labels(target: Path, labels: Mapping[str, str]) -> None:
    """Refuse labels for a log that cannot hold them.

    Raises:
        OutputError: it is a ROS 1 bag.
    """
    if labels and target.suffix == ".bag":
        raise OutputError("a ROS 1 bag holds no labels", where=target,
                          hint="write .mcap, .db3 or a rosbag2 folder")  # fmt: skip


def type_store(ros_version: int) -> Any:
    """Message classes of ROS 1 or 2, those included that rosbags lacks and we ship."""
    store = get_typestore(Stores.ROS2_JAZZY if ros_version == 2 else Stores.ROS1_NOETIC)
    for msgtype, text in {**DEFINITIONS, **LATER_DEFINITIONS}.items():
        if msgtype not in store.fielddefs:
            store.register(get_types_from_msg(text, msgtype))
    return store


@contextmanager
def _scratch(target: Path) -> Iterator[Path]:
    """A folder on the target's file system; what is made in it has names that go into files."""
    if not target.parent.is_dir():
        raise OutputError("there is no such folder", where=target.parent)
    with TemporaryDirectory(prefix=f".{target.name}.", dir=target.parent) as folder:
        yield Path(folder)


def _write_mcap(path: Path, store: Any, log: Iterable[Record], labels: Mapping[str, str]) -> Path:
    write_mcap(path, store, log, library=_LIBRARY, labels=labels)
    return path


def write_mcap(
    path: Path,
    store: Any,
    log: Iterable[Record],
    *,
    library: str,
    latched: Collection[str] | None = None,
    labels: Mapping[str, str] = _NO_LABELS,
) -> None:
    """One mcap file of profile ros2, chunk by chunk.

    Args:
        path: the file.
        store: the type store that the messages' classes are from.
        log: sorted by log time.
        library: who writes it.
        labels: of the log, written as one metadata record.
        latched: topics whose last message late subscribers get; then every topic's quality of
            service is told, as rosbag2 does, and a player offers it.
    """
    from mcap.writer import CompressionType, Writer

    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=_CHUNK_BYTES, compression=CompressionType.ZSTD)
        writer.start(profile="ros2", library=library)
        if latched is not None:
            writer.add_metadata("rosbag2", _BAG_METADATA)
        if labels:
            writer.add_metadata(LABELS_RECORD, dict(sorted(labels.items())))
        schemas: dict[str, int] = {}
        channels: dict[str, int] = {}
        for record in log:
            name = _full_name(record.msgtype)
            if name not in schemas:
                text = store.generate_msgdef(name, ros_version=2)[0].encode()
                schemas[name] = writer.register_schema(name, "ros2msg", text)
            if record.topic not in channels:
                told = {} if latched is None else _offered(record.topic in latched)
                channels[record.topic] = writer.register_channel(
                    record.topic, "cdr", schemas[name], told
                )
            writer.add_message(
                channels[record.topic],
                log_time=record.t_log_ns,
                publish_time=record.t_log_ns,
                data=bytes(store.serialize_cdr(record.message, name)),
            )
        writer.finish()


def _offered(is_latched: bool) -> dict[str, str]:
    """A channel's metadata as rosbag2 writes it."""
    from rosbags.rosbag2.metadata import dump_qos_v8

    return {"offered_qos_profiles": dump_qos_v8(_qos(latched=is_latched))}


def _write_db3(path: Path, store: Any, log: Sequence[Record], labels: Mapping[str, str]) -> Path:
    _write_rosbag2(path, store, log, "sqlite3", labels)
    return path / f"{path.name}.db3"


def _write_rosbag2(
    path: Path, store: Any, log: Sequence[Record], storage: str, labels: Mapping[str, str]
) -> None:
    from rosbags.rosbag2.enums import CompressionFormat, CompressionMode, StoragePlugin
    from rosbags.rosbag2.writer import Writer

    writer = Writer(path, version=9, storage_plugin=StoragePlugin[storage.upper()])
    if storage == "mcap":
        writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    for name, value in sorted(labels.items()):
        writer.set_custom_data(name, value)
    with writer:
        connections: dict[str, Any] = {}
        for record in log:
            name = _full_name(record.msgtype)
            if record.topic not in connections:
                connections[record.topic] = writer.add_connection(
                    record.topic,
                    name,
                    typestore=store,
                    offered_qos_profiles=_qos(latched=record.topic in LATCHED),
                )
            data = store.serialize_cdr(record.message, name)
            writer.write(connections[record.topic], record.t_log_ns, data)


def _write_bag(path: Path, store: Any, log: Sequence[Record], _labels: Mapping[str, str]) -> Path:
    from rosbags.rosbag1.writer import Writer

    writer = Writer(path)
    writer.set_compression(Writer.CompressionFormat.LZ4)
    with writer:
        connections: dict[str, Any] = {}
        for record in log:
            name = _full_name(record.msgtype)
            if record.topic not in connections:
                connections[record.topic] = writer.add_connection(
                    record.topic,
                    name,
                    typestore=store,
                    callerid="/simulator",
                    latching=int(record.topic in LATCHED),
                )
            data = store.serialize_ros1(record.message, name)
            writer.write(connections[record.topic], record.t_log_ns, data)
    return path


#: Suffix of a file to the version of ROS it belongs to and what writes it.
_FILES = {".mcap": (2, _write_mcap), ".db3": (2, _write_db3), ".bag": (1, _write_bag)}


def _full_name(msgtype: str) -> str:
    package, _, name = msgtype.partition("/")
    return f"{package}/msg/{name}"


def _qos(*, latched: bool) -> list[Qos]:
    forever = QosTime(9223372036, 854775807)
    return [
        Qos(
            QosHistory.KEEP_LAST,
            1 if latched else 10,
            QosReliability.RELIABLE,
            QosDurability.TRANSIENT_LOCAL if latched else QosDurability.VOLATILE,
            forever,
            forever,
            QosLiveliness.AUTOMATIC,
            forever,
            avoid_ros_namespace_conventions=False,
        )
    ]
