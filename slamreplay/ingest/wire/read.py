"""From payloads in a buffer to messages by columns: encodings told apart, layouts tried."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from slamreplay.geometry.times import Times
from slamreplay.ingest.wire.layout import Struct
from slamreplay.ingest.wire.messages import WireMessages
from slamreplay.ingest.wire.places import Bytes, Positions, gather
from slamreplay.ingest.wire.walk import ROS1, Encoding, walk

#: Representation identifiers of CDR's header (RTPS 2.3, 10.5; DDS-XTypes 1.3, 7.6.3.1.2).
_CDR = {
    b"\x00\x00": Encoding(">", 8, terminated=True, padding=3),
    b"\x00\x01": Encoding("<", 8, terminated=True, padding=3),
    b"\x00\x06": Encoding(">", 4, terminated=True, padding=3),
    b"\x00\x07": Encoding("<", 4, terminated=True, padding=3),
}
_HEADER = 4
#: Encodings that are read from bytes.
WIRE_ENCODINGS = frozenset({"ros1", "cdr"})


def read_messages(
    data: Bytes,
    start: Positions,
    end: Positions,
    t_log_ns: Times,
    topic: str,
    layouts: Sequence[Struct],
    encoding: str,
) -> Iterator[tuple[WireMessages, NDArray[np.int64]]]:
    """Messages by columns, each with the index (M,) of the payloads it came from.

    Payloads that no layout fits are in none of them. More than one part comes only of topics that
    mix byte orders.

    Args:
        data: the buffer.
        start: (N,) first byte of each payload.
        end: (N,) one after its last byte.
        t_log_ns: (N,) log times.
        topic: its name.
        layouts: what the type may look like, the likeliest first.
        encoding: "ros1" or "cdr".
    """
    if encoding == "ros1":
        groups = [(ROS1, np.arange(len(start)), 0)]
    else:
        whole = np.flatnonzero(end - start >= _HEADER)
        headers = gather(data, start[whole], 0, 2).view("<u2")[:, 0]
        groups = [
            (_CDR[word.tobytes()], whole[headers == word], _HEADER)
            for word in np.unique(headers)
            if word.tobytes() in _CDR
        ]
    for form, index, skip in groups:
        best = None
        for layout in layouts:
            place, sound = walk(data, start[index] + skip, end[index], layout, form)
            if best is None or sound.sum() > best[1].sum():
                best = (place, sound)
            if sound.all():
                break
        if best is not None and best[1].any():
            found = index[best[1]]
            yield WireMessages(data, best[0], t_log_ns[found], topic), found
