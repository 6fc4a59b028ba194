"""Events of services, as real recordings hold them."""

import numpy as np

from slamreplay.ingest.readers.open_log import open_log
from slamreplay.ingest.types import layouts
from slamreplay.ingest.wire.read import read_messages


def test_real_events_are_read_to_their_last_byte(real_logs):
    folder = real_logs / "fixtures/rosbag2_resources/rosbag2_tests/resources/mcap"
    (path,) = folder.rglob("bag_with_topics_and_service_events.mcap")
    with open_log([path]) as (readers, _):
        (reader,) = readers
        events = {c.index: c for c in reader.connections if c.type.endswith("_Event")}
        found = []
        for block in reader.blocks(set(events)):
            for number, connection in events.items():
                own = np.flatnonzero(block.connection == number)
                if len(own):
                    places = (block.start[own], block.end[own], block.t_log_ns[own])
                    of = (connection.topic, layouts(connection), "cdr")
                    found += [m for m, _ in read_messages(block.data, *places, *of)]

    assert sum(len(m) for m in found) == 8
    for messages in found:
        assert messages.column("info.event_type", int).tolist() == [0, 3, 0, 3]
        (_, asked), (_, answered) = messages.children("request"), messages.children("response")
        assert (asked.tolist(), answered.tolist()) == ([0, 2], [1, 3])
        assert np.ptp(messages.column("info.stamp.sec", int)) <= 1
