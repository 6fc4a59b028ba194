"""Counts, shares, rates and places as the page says them."""

from __future__ import annotations

import math
from datetime import date

from slamreplay.fleet.answers import Group, Rate, Share
from slamreplay.fleet.words import duration
from slamreplay.report.phrases import NOT_KNOWN

Box = tuple[float, float, float, float]

#: What stands for a label that nobody told.
UNTOLD = "not told"
#: So many digits of a map's hash tell it from the others of a fleet.
_VERSION_DIGITS = 8


def count(n: int, one: str, many: str | None = None) -> str:
    """A number of things: "1 log", "2,000 logs"."""
    return f"{n:,} {one if n == 1 else many or f'{one}s'}"


def logs_of_robots(group: Group) -> str:
    """How many logs of how many robots: "72 logs of 12 robots"; the robots only where told."""
    of = f" of {count(group.robots, 'robot')}" if group.robots else ""
    return f"{count(group.logs, 'log')}{of}"


def label(name: str | None) -> str:
    """A label, or that there is none."""
    return name or UNTOLD


def map_name(version: str | None) -> str:
    """A map version, short enough to read."""
    return UNTOLD if version is None else version.removeprefix("sha256:")[:_VERSION_DIGITS]


def day(when: date | None) -> str:
    """A day, or a dash."""
    return NOT_KNOWN if when is None else when.isoformat()


def span_of_days(first: date | None, last: date | None) -> str:
    """From which day to which."""
    if first is None or last is None:
        return "no day is told"
    return first.isoformat() if first == last else f"{first} to {last}"


def place(box: Box) -> str:
    """Where a box is, to the metre, in the frame of its map."""
    x0, y0, x1, y1 = box
    return f"x {x0:.0f} to {x1:.0f}, y {y0:.0f} to {y1:.0f} m"


def percent(share: float | None) -> str:
    """A share in per cent, with a digit where it is small."""
    if share is None:
        return NOT_KNOWN
    per_cent = 100.0 * share
    return f"{per_cent:.1f} %" if 0.0 < per_cent < 9.95 else f"{per_cent:.0f} %"


def share_of(share: Share) -> str:
    """How many of how many, in per cent."""
    return percent(share.value)


def interval_of(value: Share | Rate) -> str:
    """A 95 % interval in words, empty where it is not known."""
    if value.low is None or value.high is None:
        return ""
    if isinstance(value, Share):
        return f"{100.0 * value.low:.0f} to {100.0 * value.high:.0f} %"
    return f"{two_digits(value.low)} to {two_digits(value.high)}"


def two_digits(value: float) -> str:
    """A number that is known no better, without a power of ten."""
    if value == 0.0 or abs(value) >= 10.0:
        return f"{value:,.0f}"
    return f"{value:.{max(1 - math.floor(math.log10(abs(value))), 0)}f}"


def hours(h: float) -> str:
    """A time in hours, as `duration` says it."""
    return duration(3600.0 * h)
