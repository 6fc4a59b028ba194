"""rosbag2's SQLite files for tests, and where in them each message is, found the slow way."""

import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np

TOPICS = [
    (1, "/odom", "nav_msgs/msg/Odometry", "cdr"),
    (2, "/camera/image_raw", "sensor_msgs/msg/Image", "cdr"),
    (7, "/tf", "tf2_msgs/msg/TFMessage", "cdr"),
]
DEFINITIONS = {
    "nav_msgs/msg/Odometry": ("ros2msg", "float64 x\n" * 700),
    "sensor_msgs/msg/Image": ("ros2idl", "module sensor_msgs {};"),
}
QOS = "- history: 3\n  depth: 0\n  reliability: 1\n" * 12
_MESSAGES = """CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL,
    timestamp INTEGER NOT NULL, data BLOB NOT NULL)"""
_INDEX = "CREATE INDEX timestamp_idx ON messages (timestamp ASC)"
_SCHEMA = "CREATE TABLE schema(schema_version INTEGER PRIMARY KEY, ros_distro TEXT NOT NULL)"
_METADATA = """CREATE TABLE metadata(id INTEGER PRIMARY KEY, metadata_version INTEGER NOT NULL,
    metadata TEXT NOT NULL)"""
_TOPICS = """CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,
    serialization_format TEXT NOT NULL{more})"""
_DEFINITIONS = """CREATE TABLE message_definitions(id INTEGER PRIMARY KEY, topic_type TEXT NOT NULL,
    encoding TEXT NOT NULL, encoded_message_definition TEXT NOT NULL,
    type_description_hash TEXT NOT NULL)"""
_QOS, _HASH = ", offered_qos_profiles TEXT NOT NULL", ", type_description_hash TEXT NOT NULL"
#: The tables of rosbag2's schema versions 1 to 4, in the order it creates them.
SCHEMAS = {
    1: [_TOPICS.format(more=""), _MESSAGES],
    2: [_TOPICS.format(more=_QOS), _MESSAGES, _INDEX],
    3: [_SCHEMA, _METADATA, _TOPICS.format(more=_QOS), _MESSAGES, _INDEX],
    4: [_SCHEMA, _METADATA, _TOPICS.format(more=_QOS + _HASH), _DEFINITIONS, _MESSAGES, _INDEX],
}


def some_messages(sizes, seed=0):
    """(topic, time, data) with random data of these sizes; no time comes twice."""
    rng = np.random.default_rng(seed)
    topics = [topic[0] for topic in TOPICS]
    return [
        (topics[int(rng.integers(3))], 1_700_000_000_000_000_000 + 10_000_000 * i, rng.bytes(size))
        for i, size in enumerate(sizes)
    ]


def write_db3(path, messages, version=4, page_size=4096, connect=sqlite3.connect) -> Path:
    with closing(connect(path)) as database:
        database.execute(f"PRAGMA page_size = {page_size}")
        for statement in SCHEMAS[version]:
            database.execute(statement)
        add_topics(database, version)
        add_messages(database, messages)
        if version >= 3:
            database.execute("INSERT INTO schema VALUES (?, 'iron')", [version])
            database.execute("INSERT INTO metadata VALUES (1, 9, ?)", [QOS * 9])
            database.commit()
    return path


def add_topics(database, version):
    more = {1: [], 2: [QOS], 3: [QOS], 4: [QOS, "RIHS01_0"]}[version]
    for topic in TOPICS:
        row = [*topic, *more]
        database.execute(f"INSERT INTO topics VALUES ({','.join('?' * len(row))})", row)
    if version == 4:
        for kind, (encoding, text) in DEFINITIONS.items():
            database.execute(
                "INSERT INTO message_definitions VALUES (NULL, ?, ?, ?, 'RIHS01_0')",
                [kind, encoding, text],
            )
    database.commit()


def add_messages(database, messages):
    database.executemany(
        "INSERT INTO messages (topic_id, timestamp, data) VALUES (?, ?, ?)", messages
    )
    database.commit()


def rows(path):
    """What SQLite itself reads, without its changing anything."""
    uri = f"{Path(path).resolve().as_uri()}?mode=ro&immutable=1"
    with closing(sqlite3.connect(uri, uri=True)) as database:
        return database.execute(
            "SELECT topic_id, timestamp, data FROM messages ORDER BY id"
        ).fetchall()


def places(path):
    """Pages that each message of a sound file needs, and the size of a page.

    The first is {(topic, time, data): [leaf, *overflow]}. An implementation of the format of its
    own: cell by cell, in plain Python.
    """
    uri = f"{Path(path).resolve().as_uri()}?mode=ro&immutable=1"
    with closing(sqlite3.connect(uri, uri=True)) as database:
        (root,) = database.execute(
            "SELECT rootpage FROM sqlite_master WHERE name = 'messages'"
        ).fetchone()
        messages = database.execute("SELECT id, topic_id, timestamp, data FROM messages").fetchall()
    content = Path(path).read_bytes()
    size = int.from_bytes(content[16:18])
    size = 65536 if size == 1 else size
    needs = dict(_walk(content, size, size - content[20], root))
    return {tuple(message): needs[number] for number, *message in messages}, size


def _walk(content, size, usable, page):
    start = (page - 1) * size
    header = 12 if content[start] == 5 else 8
    for cell in range(int.from_bytes(content[start + 3 : start + 5])):
        slot = start + header + 2 * cell
        at = start + int.from_bytes(content[slot : slot + 2])
        if header == 12:
            yield from _walk(content, size, usable, int.from_bytes(content[at : at + 4]))
        else:
            payload, at = _varint(content, at)
            rowid, at = _varint(content, at)
            yield rowid, [page, *_chain(content, size, usable, payload, at)]
    if header == 12:
        right = int.from_bytes(content[start + 8 : start + 12])
        yield from _walk(content, size, usable, right)


def _chain(content, size, usable, payload, at):
    if payload <= usable - 35:
        return
    least = (usable - 12) * 32 // 255 - 23
    local = least + (payload - least) % (usable - 4)
    local = least if local > usable - 35 else local
    link = int.from_bytes(content[at + local : at + local + 4])
    while link:
        yield link
        link = int.from_bytes(content[(link - 1) * size : (link - 1) * size + 4])


def _varint(content, at):
    value = 0
    for _ in range(8):
        value = (value << 7) | (content[at] & 127)
        at += 1
        if content[at - 1] < 128:
            return value, at
    return (value << 8) | content[at], at + 1
