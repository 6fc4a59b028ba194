"""The clock and tf audit on the page: how each stream is dated and comes, and what tf does."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from slamreplay.evidence.result import Postmortem
from slamreplay.report.cells import Cell, Table, table
from slamreplay.report.moments import moment_cell, moment_link
from slamreplay.report.phrases import NOT_KNOWN, number

_INSPECT = "slamreplay inspect --json"


def streams(post: Postmortem) -> Table:
    """A row for each topic: how often, how regularly, and how far its stamps are from log times."""
    topics = [] if post.audit is None else post.audit["clock"]["topics"]
    rows = [
        (
            Cell(t["topic"], t["table"].replace("_", " ")),
            f"{t['rows']:,}",
            number(t["rate_hz"], ".4g", "Hz"),
            _gaps(post, t),
            Cell(_ms(t["log_minus_stamp_median_s"]), _under(t)),
            number(t["drift_ppm"], "+.0f", "ppm"),
            _stamps(t),
            t["by"],
        )
        for t in topics
    ]
    head = ("topic", "messages", "rate", "gaps", "log time minus stamp", "clock drift",
            "odd stamps", "dated by")  # fmt: skip
    return table(head, rows, _INSPECT)


def edges(post: Postmortem) -> Table:
    """A row for each edge of tf."""
    tree = [] if post.audit is None else post.audit["frames"]["tree"]
    rows = [
        (
            f"{e['parent']} \N{RIGHTWARDS ARROW} {e['child']}",
            "static" if e["is_static"] else "moving",
            ", ".join(e["topics"]) or NOT_KNOWN,
            f"{e['samples']:,}",
            number(e["rate_hz"], ".4g", "Hz"),
            Cell(f"{e['gaps']}", "" if not e["gaps"] else f"up to {e['longest_gap_s']:.2f} s"),
            _ms(e["log_minus_stamp_median_s"]),
            NOT_KNOWN if e["ahead_s"] is None else f"{_ms(e['ahead_s'])}, over the {e['ahead_of']}",
        )
        for e in tree
    ]
    head = ("parent and child", "kind", "topic", "samples", "rate", "gaps", "log time minus stamp",
            "dated ahead by")  # fmt: skip
    return table(head, rows, _INSPECT)


def covers(post: Postmortem) -> Table:
    """For each laser, whether transforms were there when its scans needed them."""
    found = {} if post.audit is None else post.audit["frames"]["cover"]
    rows = [
        (
            topic,
            f"{c['scans']:,}",
            Cell(f"{c['early'] + c['late']:,}", _beyond(c["outside_s"], "by up to")),
            Cell(f"{c['bridged']:,}", _beyond(c["bridged_s"], "up to")),
            Cell(f"{c['waiting']:,}", _beyond(c["wait_median_s"], "typically")),
            _worst(post, c),
            f"{c['forgotten']:,}",
        )
        for topic, c in found.items()
    ]
    head = ("laser", "scans", "outside all transforms", "between two that are a gap apart",
            "came before their transform", "longest wait", "transform forgotten")  # fmt: skip
    return table(head, rows, _INSPECT)


def steps(post: Postmortem) -> Table:
    """The largest steps of odometry and of the localizer's corrections."""
    frames: Mapping[str, Any] = {} if post.audit is None else post.audit["frames"]
    names = {"odometry_jumps": "odometry jumped", "corrections": "the localizer corrected"}
    rows = [
        (
            Cell(name, f"{frames[key]['count']:,} in all" if not k else ""),
            moment_cell(post, one["t_ns"]),
            number(one["m"], ".3f", "m"),
            number(np.degrees(one["rad"]), ".1f", "deg"),
        )
        for key, name in names.items()
        if frames.get(key)
        for k, one in enumerate(frames[key]["worst"])
        if one["m"] > 0.0 or one["rad"] > 0.0
    ]
    return table(("what", "when", "by", "and"), rows, _INSPECT)


def clock_notes(post: Postmortem) -> tuple[str, ...]:
    """What else is to be said of clock and frames, a sentence each."""
    if post.audit is None:
        return ()
    simulated, frames = post.audit["clock"]["simulated"], post.audit["frames"]
    notes = []
    if simulated is not None:
        pace = "" if simulated["pace"] is None else f", {simulated['pace']:.3g} times the log's"
        notes.append(
            f"{simulated['topic']} told a simulated time {simulated['messages']:,} times{pace}."
        )
    if frames["without_tf"]:
        names = ", ".join(frames["without_tf"])
        notes.append(f"Sensor frames without tf, taken to be the base itself: {names}.")
    notes += [
        f"{e['parent']} \N{RIGHTWARDS ARROW} {e['child']} was left out: {e['reason']}."
        for e in frames["left_out"]
    ]
    notes += [
        f"{', '.join(loose['topics'])}: in {loose['frame']}, "
        f"{'another tree of tf' if loose['on_tf'] else 'which is not on tf'}."
        for loose in frames["loose"]
    ]
    return tuple(notes)


def _gaps(post: Postmortem, topic: Mapping[str, Any]) -> Cell:
    if topic["gap_count"] is None:
        return Cell(NOT_KNOWN)
    missing = f"{topic['missing']:,} messages missing" if topic["missing"] else ""
    if not topic["gaps"]:
        return Cell("none", missing)
    worst = topic["gaps"][0]
    length = (worst["end_ns"] - worst["start_ns"]) / 1e9
    text = f"{topic['gap_count']}, up to {length:.2f} s"
    link = moment_link(post, worst["start_ns"])
    return Cell(text, missing, ((text, link),) if link else ())


def _under(topic: Mapping[str, Any]) -> str:
    late = topic["log_minus_stamp_p95_s"]
    return "" if late is None else f"95 of 100 below {_ms(late)}"


def _stamps(topic: Mapping[str, Any]) -> Cell:
    """Jumps against the log time, and stamps that are none, stand still or go back."""
    words = [
        f"{topic[key]:,} {name}"
        for key, name in (
            ("backward_stamps", "go back"),
            ("repeated_stamps", "repeat"),
            ("unstamped", "without"),
        )
        if 0 < topic[key] < topic["rows"]  # what has no stamps at all is dated by the log
    ]
    jumps = topic["jumps"] or ()
    if jumps:
        largest = max(jumps, key=lambda jump: abs(jump["seconds"]))
        count = f"{len(jumps)} jumps, up to" if len(jumps) > 1 else "a jump of"
        words.insert(0, f"{count} {largest['seconds']:+.3f} s")
    return Cell(", ".join(words) or "none")


def _worst(post: Postmortem, told: Mapping[str, Any]) -> Cell:
    text, link = _ms(told["wait_most_s"]), moment_link(post, told["worst_ns"])
    return Cell(text, links=((text, link),) if link else ())


def _beyond(seconds: float, word: str) -> str:
    return f"{word} {_ms(seconds)}" if seconds else ""


def _ms(seconds: float | None) -> str:
    if seconds is None:
        return NOT_KNOWN
    return f"{1e3 * seconds:.1f} ms" if abs(seconds) < 10.0 else f"{seconds:,.1f} s"
