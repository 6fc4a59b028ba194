"""What a log says of itself beside its messages: site, robot, software and the like.

MCAP: its metadata records. Of the record `slamreplay.labels` all keys are labels, of others those
that mean site, robot or software. rosbag2: `custom_data`, as of `ros2 bag record --custom-data`, in
metadata.yaml, in an mcap file's record `rosbag2` and in a database's table `metadata`; all of it
are labels. ROS 1 bags, text logs and bundles carry none.
"""

from __future__ import annotations

import re
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import closing
from pathlib import Path

import yaml

from slamreplay.ingest.readers import mcap_file, sqlite_file
from slamreplay.ingest.readers.mcap_metadata import metadata_records

#: The record in which `simulate --label` writes.
RECORD = "slamreplay.labels"
#: Column of a fleet's tables to the keys that mean it, the first that there is counts. They are
#: compared in small letters with _ between words: `robotId` and `Robot ID` are robot_id.
MEANINGS: Mapping[str, tuple[str, ...]] = {
    "site": ("site", "site_name", "site_id", "facility", "warehouse", "plant", "location"),
    "robot": (
        "robot", "robot_name", "robot_id", "robot_serial", "vehicle", "vehicle_name", "vehicle_id",
        "device", "device_name", "device_id", "serial_number", "hostname", "host",
    ),
    "software": (
        "software", "software_version", "sw_version", "software_release", "release", "build",
        "git_commit", "git_sha", "version",
    ),
}  # fmt: skip
_MOST_LABELS, _MOST_TEXT = 40, 500
_METADATA, _CUSTOM_DATA = "metadata.yaml", "custom_data"
#: Records whose keys are labels, whatever they are called.
_LABELS = (RECORD, _CUSTOM_DATA)
_CUSTOM = re.compile(r"^( *)custom_data:", re.MULTILINE)


def log_labels(path: Path) -> dict[str, str]:
    """The labels of a log, by name; none where there are none or they cannot be read.

    Costs a few reads of a file of any size that was closed.

    Args:
        path: as of `ingest`: a file, or a folder of rosbag2.
    """
    meant: dict[str, str] = {}
    beside: dict[str, str] = {}
    try:
        for name, content in _records(path):
            given = {_snake(key): _plain(value) for key, value in content.items()}
            into = meant if name in _LABELS else beside
            into |= {k: v for k, v in given.items() if k and v and k not in into}
    except (OSError, sqlite3.Error, ValueError):
        pass  # whether the log can be read is found out, and told, when it is read
    likely = {k: v for k, v in with_meanings(beside).items() if k in MEANINGS}
    found = {**likely, **with_meanings(meant)}
    return dict(sorted(found.items())[:_MOST_LABELS])


def with_meanings(labels: Mapping[str, str]) -> dict[str, str]:
    """The labels, with `site`, `robot` and `software` where another key of them means it."""
    found = dict(labels)
    for column, keys in MEANINGS.items():
        value = next((labels[key] for key in keys if labels.get(key)), None)
        if value is not None:
            found[column] = value
    return found


def is_label(name: str, value: str) -> bool:
    """Whether a name and a text are read back as they were written."""
    return bool(name) and _snake(name) == name and bool(value) and _plain(value) == value


def _records(path: Path) -> Iterator[tuple[str, Mapping[str, str]]]:
    """Name and content of what may hold labels; what comes first holds."""
    if path.is_dir():
        metadata = path / _METADATA
        if metadata.is_file():
            yield _CUSTOM_DATA, _custom_data(metadata.read_text(encoding="utf-8", errors="replace"))
        files = sorted(p for p in path.iterdir() if p.suffix in (".mcap", ".db3") and p.is_file())
    else:
        files = [path]
    for file in files[:1]:  # all files of a log say the same
        with file.open("rb") as stream:
            head = stream.read(len(sqlite_file.MAGIC))
        if head.startswith(mcap_file.MAGIC):
            yield from _of_mcap(file)
        elif head.startswith(sqlite_file.MAGIC):
            yield from _of_database(file)


def _of_mcap(file: Path) -> Iterator[tuple[str, Mapping[str, str]]]:
    for name, content in metadata_records(file):
        if name == "rosbag2":
            yield _CUSTOM_DATA, _custom_data(content.get("serialized_metadata", ""))
        else:
            yield name, content


def _of_database(file: Path) -> Iterator[tuple[str, Mapping[str, str]]]:
    address = f"{file.resolve().as_uri()}?mode=ro&immutable=1"
    with closing(sqlite3.connect(address, uri=True)) as database:
        rows = database.execute("SELECT metadata FROM metadata ORDER BY id DESC LIMIT 1").fetchall()
    for (text,) in rows:
        yield _CUSTOM_DATA, _custom_data(text if isinstance(text, str) else "")


def _custom_data(text: str) -> Mapping[str, str]:
    """That key of rosbag2's metadata; the rest, which may be long, is not parsed."""
    found = _CUSTOM.search(text)
    if found is None:
        return {}
    lines = text[found.start() :].split("\n")
    indent = len(found[1])
    inner = [lines[0]]
    for line in lines[1:]:
        if line.strip() and len(line) - len(line.lstrip(" ")) <= indent:
            break
        inner.append(line)
    try:
        given = yaml.load("\n".join(inner)[:100_000], Loader=yaml.BaseLoader)  # noqa: S506 - texts only
    except (yaml.YAMLError, RecursionError):
        return {}
    data = given.get(_CUSTOM_DATA) if isinstance(given, dict) else None
    if not isinstance(data, dict):
        return {}
    return {k: v for k, v in data.items() if isinstance(k, str) and isinstance(v, str)}


def _snake(key: str) -> str:
    key = re.sub(r"([a-z0-9])([A-Z])", r"\1_\2", key).lower()
    return re.sub(r"[^a-z0-9]+", "_", key).strip("_")[:40]


def _plain(value: str) -> str:
    """One printable line."""
    return "".join(c if c.isprintable() else " " for c in value).strip()[:_MOST_TEXT]
