"""Lines of a CARMEN log as numbers: fields counted, times exact, everything odd counted.

A line is a keyword, its fields, and `ipc_timestamp ipc_hostname logger_timestamp` (CARMEN's
logger/writelog.c and global/readlog.c). Lasers come in two layouts: FLASER and RLASER (readings,
laser pose, robot pose), and those that begin with the laser's configuration: RAWLASER1 to 5
(readings, remissions) and ROBOTLASER1 and 2 (these, both poses, velocities, safety distances).
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.manifest import Loss
from slamreplay.geometry.times import Times, from_decimal_seconds, in_order
from slamreplay.ingest.text_logs.numbers import table_of_numbers

_MESSAGE = re.compile(rb"[A-Z][A-Z0-9_-]*\Z")
_LASER = re.compile(rb"(?:[FR]LASER|(?:RAW|ROBOT)LASER\d)\Z")
#: Fields of a laser's configuration; logs before 2006 have no remission mode.
_CONFIGURATION = (7, 6)
#: Fields of ODOM (x y theta tv rv acceleration) and TRUEPOS (true pose, odometry pose).
_FIXED = {b"ODOM": 6, b"TRUEPOS": 6}
_TIMES = 3
#: Number in the file, fields, ipc time and logger's time.
_Line = tuple[int, bytes, bytes, bytes]


@dataclass(frozen=True)
class Layout:
    """Where the readings are among the fields of a laser's line.

    Attributes:
        configuration: fields before the number of readings.
        readings: how many readings follow that number.
        remissions: how many remissions follow theirs; None where the line has no such number.
    """

    configuration: int = 0
    readings: int = 0
    remissions: int | None = None

    @property
    def tail(self) -> int:
        """Where the fields after readings and remissions begin."""
        more = 0 if self.remissions is None else 1 + self.remissions
        return self.configuration + 1 + self.readings + more


@dataclass(frozen=True, eq=False)
class Group:
    """All lines of one keyword and layout.

    Attributes:
        keyword: "FLASER", "ODOM" and the like.
        layout: of a laser's fields.
        line: (N,) number of the line in the file, from 0 on.
        fields: (N, W) the numbers between keyword and times.
        t_sensor_ns: (N,) the ipc time: when the message was made.
        t_log_ns: (N,) the logger's time: seconds since it was started, in the order of the file.
    """

    keyword: str
    layout: Layout
    line: NDArray[np.int64]
    fields: NDArray[np.float64]
    t_sensor_ns: Times
    t_log_ns: Times


@dataclass(frozen=True, eq=False)
class CarmenLines:
    """A log's messages by keyword, its parameters, and what was not used."""

    groups: dict[str, list[Group]]
    params: dict[str, str]
    losses: list[Loss]


def read_lines(lines: Sequence[bytes], name: str) -> CarmenLines:
    """Messages of a CARMEN log.

    Args:
        lines: of the file.
        name: of the file, for the losses.
    """
    found: dict[tuple[str, Layout], list[_Line]] = {}
    params: dict[str, str] = {}
    skipped: Counter[str] = Counter()
    lost: Counter[tuple[str, str]] = Counter()
    for number, line in enumerate(lines):
        words = line.split()
        if not words or words[0].startswith(b"#"):
            continue
        keyword, known = _text(words[0]), _is_known(words[0])
        layout = _layout(words) if known else None
        if layout is not None:
            one = (number, b" ".join(words[1:-_TIMES]), words[-3], words[-1])
            found.setdefault((keyword, layout), []).append(one)
        elif words[0] == b"PARAM" and len(words) > 2:
            params[_text(words[1])] = _text(words[2])
        elif known or words[0] == b"PARAM":
            lost[keyword, "wrong number of fields"] += 1
        elif _MESSAGE.match(words[0]):
            skipped[keyword] += 1
        else:
            lost["lines", "they begin with no message's name"] += 1
    groups = [_group(keyword, layout, rows, lost) for (keyword, layout), rows in found.items()]
    groups, moved = _with_log_order([g for g in groups if len(g.line)])
    losses = [_loss("lost", name, what, n, why) for (what, why), n in lost.items() if n]
    losses += [_loss("skipped", name, what, n, "no decoder for it") for what, n in skipped.items()]
    if moved:
        reason = "logger times step back, the order of the lines holds"
        losses.append(_loss("repaired", name, "logger times", moved, reason))
    by_keyword: dict[str, list[Group]] = {}
    for group in groups:
        by_keyword.setdefault(group.keyword, []).append(group)
    return CarmenLines(by_keyword, params, losses)


def is_carmen(head: bytes) -> bool:
    """Whether a text's first bytes are those of a CARMEN log."""
    for line in head.split(b"\n")[:-1]:
        words = line.split()
        if words and _is_known(words[0]) and _layout(words) is not None:
            return True
        if line.startswith(b"# CARMEN Logfile"):
            return True
    return False


def _is_known(keyword: bytes) -> bool:
    return keyword in _FIXED or _LASER.match(keyword) is not None


def _layout(words: Sequence[bytes]) -> Layout | None:
    """How the fields of a line with a known keyword are laid out, or None where they do not fit."""
    inner = len(words) - 1 - _TIMES
    if words[0] in _FIXED:
        return Layout() if inner == _FIXED[words[0]] else None
    is_plain, is_raw = words[0].endswith(b"LASER"), words[0].startswith(b"RAW")
    after = 6 if is_plain else 0 if is_raw else 11
    for configuration in (0,) if is_plain else _CONFIGURATION:
        readings = _count(words, 1 + configuration)
        if readings is None:
            continue
        remissions = None if is_plain else _count(words, 2 + configuration + readings)
        layout = Layout(configuration, readings, remissions)
        if (is_plain or remissions is not None) and layout.tail + after == inner:
            return layout
    return None


def _count(words: Sequence[bytes], at: int) -> int | None:
    return int(words[at]) if at < len(words) and words[at].isdigit() else None


def _group(
    keyword: str, layout: Layout, rows: Sequence[_Line], lost: Counter[tuple[str, str]]
) -> Group:
    number, fields, made, logged = (list(column) for column in zip(*rows, strict=True))
    values, sound = table_of_numbers(fields, 1 + fields[0].count(b" "))
    t_sensor, is_made = from_decimal_seconds(made)
    t_log, is_logged = from_decimal_seconds(logged)
    lost[keyword, "a field is no number"] += int((~sound).sum())
    lost[keyword, "a time is no number"] += int((sound & ~(is_made & is_logged)).sum())
    keep = sound & is_made & is_logged
    line = np.array(number, dtype=np.int64)
    return Group(keyword, layout, line[keep], values[keep], t_sensor[keep], t_log[keep])


def _with_log_order(groups: Sequence[Group]) -> tuple[list[Group], int]:
    """Groups whose logger times never step back along the file, and how many had to be moved.

    The logger writes a message when it comes; where its times step back they were made up later
    (converters took the ipc time), or its host's clock was set.
    """
    if not groups:
        return [], 0
    line = np.concatenate([g.line for g in groups])
    order = np.argsort(line)
    t_log, moved = in_order(np.concatenate([g.t_log_ns for g in groups])[order])
    back = np.empty_like(t_log)
    back[order] = t_log
    stops = np.cumsum([len(g.line) for g in groups])
    parts = np.split(back, stops[:-1])
    out = [replace(g, t_log_ns=part) for g, part in zip(groups, parts, strict=True)]
    return out, int(moved.sum())


def _loss(kind: str, name: str, what: str, count: int, reason: str) -> Loss:
    return Loss(kind=kind, what=f"{name}: {what}", count=count, reason=reason)  # type: ignore[arg-type]


def _text(word: bytes) -> str:
    return word.decode("ascii", "replace")
