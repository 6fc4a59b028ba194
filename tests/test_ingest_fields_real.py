"""Every field of real recordings, of every type, as rosbags and the mcap package read it."""

from collections import Counter
from contextlib import closing
from itertools import islice

import numpy as np
import pytest
from test_ingest_wire import assert_same

from slamreplay.errors import LogError
from slamreplay.ingest.readers.open_log import open_log
from slamreplay.ingest.readers.reader import normalise_type
from slamreplay.ingest.types import layouts
from slamreplay.ingest.wire.read import read_messages

#: Messages of a topic that are compared to the last number; of the others the bytes are.
MOST = 60


def logs_of(root):
    """Every bag, mcap, db3 and rosbag2 folder of the real logs, small files first."""
    folders = {p.parent for p in root.rglob("metadata.yaml")}
    files = [p for p in root.rglob("*") if p.suffix in (".bag", ".mcap", ".db3")]
    alone = [p for p in files if p.parent not in folders]
    return sorted([*folders, *alone], key=lambda p: (p.is_dir(), str(p)))


def ours(path):
    """(topic, type, log time, payload) of all messages, and where the first of each topic are."""
    payloads, columns = Counter(), []
    with open_log([path]) as (readers, _):
        for reader in readers:
            for block in reader.blocks(range(len(reader.connections))):
                for connection in reader.connections:
                    own = np.flatnonzero(block.connection == connection.index)
                    for k in own.tolist():
                        data = block.data[block.start[k] : block.end[k]].tobytes()
                        key = (connection.topic, connection.type, int(block.t_log_ns[k]), data)
                        payloads[key] += 1
                    columns.append((connection, block, own[:MOST]))
    return payloads, columns


@pytest.mark.filterwarnings("ignore::ResourceWarning")  # rosbags leaves a log that it refuses open
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_rosbags_reads_the_same_bytes_and_fields(real_logs):
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    compared = refused = 0
    for path in logs_of(real_logs / "fixtures"):
        try:
            payloads, columns = ours(path)
        except LogError:
            refused += 1
            continue
        try:
            reader = AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE))
            reader.open()
        except Exception:
            refused += 1  # theirs: odd indices, no messages
            continue
        with closing(reader):
            theirs = Counter(
                (c.topic, normalise_type(c.msgtype), t, bytes(d)) for c, t, d in reader.messages()
            )
            # Where metadata.yaml says 0 messages rosbags reads none; the mcap package has them.
            assert payloads == theirs or (not theirs and path.is_dir()), path
            for connection, block, index in columns:
                compared += compare(reader, connection, block, index)
    assert compared > 500
    assert refused < 6


def compare(reader, connection, block, index):
    """Fields of the messages at `index`; how many messages were compared."""
    try:
        known = layouts(connection)
    except LogError:
        return 0
    places = (block.start[index], block.end[index], block.t_log_ns[index])
    count = 0
    for messages, found in read_messages(
        block.data, *places, connection.topic, known, connection.encoding
    ):
        payloads = [block.data[block.start[k] : block.end[k]].tobytes() for k in index[found]]
        try:
            items = [reader.deserialize(p, connection.type) for p in payloads]
        except Exception:
            continue  # a service's event, which rosbags has no name for
        assert_same(messages, items, known[0])
        count += len(items)
    return count


def test_the_mcap_package_reads_the_same_messages(real_logs):
    from mcap.reader import NonSeekingReader

    compared = 0
    for path in sorted(real_logs.rglob("*.mcap")):
        payloads, _ = ours(path)
        with path.open("rb") as stream:
            read = NonSeekingReader(stream).iter_messages(log_time_order=False)
            theirs = Counter(
                (channel.topic, message.log_time, bytes(message.data))
                for _, channel, message in islice(read, None)
            )
        mine = Counter()
        for (topic, _, t_log_ns, data), count in payloads.items():
            mine[topic, t_log_ns, data] += count
        assert mine == theirs, path
        compared += sum(theirs.values())
    assert compared > 1000
