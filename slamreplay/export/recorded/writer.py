"""recorded.mcap: the streams of all tables, merged by log time, written chunk by chunk."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from slamreplay.bundle.view import Bundle
from slamreplay.errors import UsageError
from slamreplay.export.formats import NotAsRecorded
from slamreplay.export.recorded.localization import localization
from slamreplay.export.recorded.maps import maps, write_map_files
from slamreplay.export.recorded.motion import motion
from slamreplay.export.recorded.navigation import navigation
from slamreplay.export.recorded.ranging import ranging
from slamreplay.export.recorded.recovering import recovering
from slamreplay.export.recorded.references import references
from slamreplay.export.recorded.selection import selected
from slamreplay.export.recorded.stream import Composer, Encoded, Stream
from slamreplay.export.request import Request
from slamreplay.simulate.topics import Record
from slamreplay.simulate.writer import type_store, write_mcap

FILE = "recorded.mcap"
_LIBRARY = "slamreplay export"
#: How often progress is told.
_TOLD = 200
_NO_NAME = re.compile(r"[^A-Za-z0-9_/]+")


def write_recorded(request: Request, folder: Path) -> list[NotAsRecorded]:
    """Write the log and its map's files; returned is what of the bundle they do not hold.

    Raises:
        UsageError: nothing of the log lies in the window.
    """
    bundle, window = request.bundle, request.span
    store = type_store(2)
    ros = Composer(store, 2)
    rows, low_ns = selected(bundle, request.window)
    types = {role.topic: role.type for role in bundle.manifest.roles}
    tf_topics = set(rows["transforms"].of_topics())
    parts = (
        motion(rows, ros),
        ranging(rows, types, ros),
        localization(rows, ros),
        references(rows, tf_topics, ros),
        navigation(rows, types, ros),
        recovering(rows, ros),
        maps(bundle, window, low_ns, ros),
    )
    streams = _named(parts)
    if not streams:
        raise UsageError("nothing was recorded between --start and --end")
    messages = _merged(streams, request)
    latched = {s.topic for s in streams if s.latched}
    write_mcap(folder / FILE, store, messages, library=_LIBRARY, latched=latched)
    write_map_files(bundle, window, folder)
    return [*(one for part in parts for one in part.not_as_recorded), *_left_out(bundle)]


def _named(parts: Sequence[Encoded]) -> list[Stream]:
    """All streams with names that ROS 2 can have, no two types on one topic."""
    found: list[Stream] = []
    types: dict[str, str] = {}
    for stream in (s for part in parts for s in part.streams):
        name = "/" + _NO_NAME.sub("_", stream.topic).strip("/")
        if types.setdefault(name, stream.msgtype) != stream.msgtype:
            name = f"{name}/{stream.msgtype.rpartition('/')[2].lower()}"
            types[name] = stream.msgtype
        found.append(replace(stream, topic=name))
    return found


def _merged(streams: Sequence[Stream], request: Request) -> Iterator[Record]:
    """Messages of all streams by log time; of one moment what is latched comes first."""
    t_log_ns = np.concatenate([s.t_log_ns for s in streams])
    which = np.repeat(np.arange(len(streams)), [len(s.t_log_ns) for s in streams])
    row = np.concatenate([np.arange(len(s.t_log_ns)) for s in streams])
    late = np.array([not s.latched for s in streams])[which]
    order = np.lexsort((row, which, late, t_log_ns))
    every = max(len(order) // _TOLD, 1)
    for done, k in enumerate(order.tolist()):
        stream, i = streams[which[k]], int(row[k])
        yield Record(int(t_log_ns[k]), stream.topic, stream.msgtype, stream.message(i))
        if done % every == 0:
            request.say("writing", done / len(order))


def _left_out(bundle: Bundle) -> list[NotAsRecorded]:
    """What of tf no bundle's tree holds."""
    return [
        NotAsRecorded(f"tf {e.parent} -> {e.child}", e.samples, f"left out of the tree: {e.fault}")
        for e in bundle.manifest.frames.left_out
    ]
