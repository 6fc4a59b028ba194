"""Messages as a log holds them: serialised by rosbags, read back by ingest."""

import numpy as np

from slamreplay.bundle.tables import Ragged
from slamreplay.ingest.readers.reader import Connection
from slamreplay.ingest.rows import read_rows


class Container:
    """A log in memory with one topic; without definitions, so that the shipped ones are used."""

    sources = ()

    def __init__(self, topic, kind, payloads, encoding):
        self.connections = (Connection(0, topic, kind, encoding, "", "msg", len(payloads)),)
        self.losses = []
        self._payloads = payloads

    def messages(self, wanted):
        yield from ((0, 10 * (k + 1), payload) for k, payload in enumerate(self._payloads))


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
