"""Messages as a log holds them: serialised by rosbags, read back by ingest."""

from itertools import accumulate, pairwise

import numpy as np

from slamreplay.bundle.tables import Ragged
from slamreplay.ingest.readers.reader import Block, Connection
from slamreplay.ingest.reading import read_rows


class Container:
    """A log in memory with one topic; without definitions, so that the shipped ones are used."""

    sources = ()

    def __init__(self, topic, kind, payloads, encoding, *, at_once=10**9):
        self._at_once = at_once  # messages in a block
        self.connections = (Connection(0, topic, kind, encoding, "", "msg", len(payloads)),)
        self.losses = []
        self._payloads = payloads

    def blocks(self, wanted):
        if 0 in wanted:
            ends = [0, *accumulate(len(payload) for payload in self._payloads)]
            found = [(0, a, b, 10 * (k + 1)) for k, (a, b) in enumerate(pairwise(ends))]
            for k in range(0, len(found), self._at_once):
                yield Block.of(b"".join(self._payloads), found[k : k + self._at_once])


def read_back(logs, kind, make, *, topic="/topic", ros=(1, 2)):
    """Rows and losses of the messages that `make(ros)` gives, the same in ROS 1 and in ROS 2.

    Args:
        logs: the LogWriter.
        kind: message type.
        make: called with the ROS version, gives a list of messages.
        topic: name of the topic.
        ros: versions in which the type exists.
    """
    results = []
    for version in ros:
        store = logs.stores[version]
        serialise = store.serialize_ros1 if version == 1 else store.serialize_cdr
        payloads = [bytes(serialise(message, kind)) for message in make(version)]
        encoding = "ros1" if version == 1 else "cdr"
        rows, losses = read_rows([Container(topic, kind, payloads, encoding)], lambda _: None, None)
        assert len(rows) == 1, losses
        told = {(loss.kind, loss.reason): loss.count for loss in losses}
        assert not any("cannot be decoded" in reason for _, reason in told), told
        results.append((rows[0], told))
    first, told = results[0]
    for other, others_told in results[1:]:
        assert told == others_told
        np.testing.assert_array_equal(first.t_sensor_ns, other.t_sensor_ns)
        for name, column in first.columns.items():
            np.testing.assert_array_equal(plain(column), plain(other.columns[name]))
    return first, told


def plain(column):
    return column.values if isinstance(column, Ragged) else column
