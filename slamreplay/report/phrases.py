"""Numbers and times as people read them, and the figures in words."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from slamreplay.evidence.words import STATES, confidence_text
from slamreplay.geometry.times import NS_PER_S

if TYPE_CHECKING:
    from slamreplay.evidence.result import Postmortem
    from slamreplay.verdict.reliability import Reliability

#: What stands in a cell for a number that is not known.
NOT_KNOWN = "-"


_QUANTITY = re.compile(r"(?<=\d) (?=(?:s|m|m²|cm|deg|rad|%|min|h)(?!\w))")


def bound(text: str) -> str:
    """The text with numbers tied to their units, so that no line breaks between them."""
    return _QUANTITY.sub("\N{NO-BREAK SPACE}", text)


def percent(share: float) -> str:
    """A share from 0 to 1 of what was counted; of what is believed see `confidence_text`."""
    return f"{100.0 * share:.0f} %"


def seconds(t_ns: float) -> str:
    """A duration in ns."""
    return f"{t_ns / NS_PER_S:.1f} s"


def number(value: float | None, form: str = ".2f", unit: str = "") -> str:
    """A number, or a dash where it is not known."""
    if value is None or not np.isfinite(value):
        return NOT_KNOWN
    return f"{value:{form}}{' ' if unit else ''}{unit}"


def short(value: float | None) -> str:
    """Three digits, and no power of ten where plain digits are shorter."""
    return number(value, ".0f" if value is not None and abs(value) >= 1000.0 else ".3g")


def p_value(value: float | None) -> str:
    """Of a test, or a dash."""
    if value is None:
        return NOT_KNOWN
    return "< 1e-12" if value < 1e-12 else f"{value:.1g}"


def span(post: Postmortem, start_ns: int | None, end_ns: int | None) -> str:
    """From when to when, in s since the log's start."""
    origin = post.manifest.start_ns
    if start_ns is None:
        return ""
    if end_ns is None or end_ns == start_ns:
        return seconds(start_ns - origin)
    return f"{(start_ns - origin) / NS_PER_S:.1f} to {seconds(end_ns - origin)}"


def map_alt(post: Postmortem) -> str:
    """The map figure in words."""
    error = post.error
    if error is None or not np.isfinite(error.distance_m).any():
        return "Map with the path of the robot, as far as it is known."
    worst = int(np.nanargmax(error.distance_m))
    return (
        "Map with the believed path and the path rebuilt in hindsight; they are "
        f"{error.distance_m[worst]:.2f} m apart at worst, at "
        f"{float(post.seconds(error.t_ns[worst])):.1f} s."
    )


def map_note(post: Postmortem) -> str:
    """Which of several maps places and changes are drawn in; nothing where one held all along."""
    maps = post.manifest.maps
    if post.grid is None or len(maps) < 2:
        return ""
    held = [span for m in maps if m.version == post.grid.version for span in m.held_ns]
    since = f" from {seconds(held[-1][0] - post.manifest.start_ns)} on" if held else ""
    text = (
        f"{len(maps)} map versions held, one after the other. Each moment was compared with its "
        f"own; regions, changed.pgm and freshness are drawn in the last one, which held{since}."
    )
    if post.drawn_from_ns > post.manifest.start_ns:
        first = seconds(post.drawn_from_ns - post.manifest.start_ns)
        text += f" Until {first} the log is in another map and not in this figure."
    return text


def course_alt(post: Postmortem) -> str:
    """The figure of the log's course in words."""
    states = "; ".join(
        f"{STATES[i.state].name} {span(post, i.start_ns, i.end_ns)}"
        for i in post.judgement.intervals[:8]
    )
    return f"Error of the belief and share of changed beams over time. {states}."


def covariance_alt(post: Postmortem) -> str:
    """The covariance figure in words."""
    mean = None if post.nees is None else post.nees.summary().test.mean
    if mean is None:
        return "Covariance ellipses along the believed path."
    return (
        "Covariance ellipses along the believed path, claimed against real error, and NEES over "
        f"time with a mean of {mean:.3g} where 3 is expected."
    )


def graph_alt(post: Postmortem) -> str:
    """The picture of SLAM's map in words."""
    if post.slam is None:
        return ""
    taken, asked = int(post.slam.accepted.sum()), len(post.slam.closures)
    return (
        f"The map that the pose graph made, its {len(post.slam.node_xyyaw)} nodes, and "
        f"{asked} places that were looked for again, of which {taken} close a loop."
    )


def trials_note(post: Postmortem) -> str:
    """What the trials' errors are measured against."""
    told = [name for t in post.trials for name, value in t.metrics.items() if value is not None]
    if "relations_m" in told:
        return (
            "Relations are motions between two scans that somebody measured: a trajectory's mean "
            "error of them needs no frame in common."
        )
    if "reference_rmse_m" in told:
        return "Errors are distances to the log's own reference, nothing aligned."
    if any(name.startswith("hindsight_") for name in told):
        return "Errors are distances to hindsight, nothing aligned."
    if "ate_aligned_m" in told:
        return (
            "The log's own reference is in a frame of its own: errors are those of the whole path "
            "laid onto it."
        )
    return "Nothing judges these runs: what is told is how far they are from the baseline."


def reference_note(post: Postmortem) -> str:
    """What the covariance was measured against."""
    if post.reference_kind is None:
        return "There is no reference to measure the belief's errors against."
    if post.reference_kind == "hindsight":
        return (
            "Measured against hindsight, which shares its scans with the belief: it can show "
            "over-confidence and never proves consistency."
        )
    return f"Measured against the log's own reference ({post.reference_kind.replace('_', ' ')})."


def confidence_note(confidence: float | None, record: Reliability) -> str:
    """How often states said with this confidence were the true ones."""
    where = (
        f"on {record.logs} simulated logs that nothing of the program was tuned on "
        f"({record.moments:,} moments, expected calibration error {short(record.ece)}). "
        "Real robots may fail in ways that no simulation shows."
    )
    if confidence is None:
        return f"This log's state has no confidence. The diagram was measured {where}"
    alike = record.bin_of(confidence)
    if alike is None:
        return f"Nothing was ever said with {confidence_text(confidence)} confidence {where}"
    low, high, right = (f"{100.0 * x:.3g}" for x in (alike.low, alike.high, alike.right))
    return (
        f"This log's state is said with {confidence_text(confidence)} confidence. Moments said "
        f"with {low} to {high} % were right in {right} % of the cases, measured {where}"
    )


def reliability_alt(record: Reliability) -> str:
    """The reliability diagram in words."""
    rows = (f"said {b.said:.2f}, right {b.right:.2f}" for b in record.bins)
    return "Reliability diagram: " + "; ".join(rows) + "."
