"""What was found, as columns: paths, errors, the verdict, its intervals, findings and trials."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations_with_replacement

import numpy as np

from slamreplay.bundle.findings import Finding
from slamreplay.bundle.track import PoseTrack
from slamreplay.evidence.result import Postmortem
from slamreplay.export.request import Request, Window
from slamreplay.export.spreadsheets.columns import Cells, numbers, texts

_T = "time on the bundle's clock"
_AXES = ("x", "y", "yaw")
_UNITS = {"x": "m", "y": "m", "yaw": "rad"}


def answers(request: Request, post: Postmortem) -> dict[str, list[Cells]]:
    """Name of each file to its columns; what the log could not tell has no file."""
    window = request.span
    files = {"verdict": _verdict(post), "intervals": _intervals(post, window)}
    files["findings"] = _findings([f for f in post.findings if _touches(f, window)])
    if post.belief is not None:
        files["belief"] = _path(post.belief, window)
    found = post.hindsight
    if found is not None:
        keep = window.holds(found.track.t_ns)
        match = numbers("match", found.match[keep], "1", "how well the map explains the scan")
        files["hindsight"] = [*_path(found.track, window), match]
    if post.error is not None:
        error, keep = post.error, window.holds(post.error.t_ns)
        files["errors"] = [
            numbers("t_ns", error.t_ns[keep], "ns", _T),
            numbers("distance_m", error.distance_m[keep], "m", "belief from hindsight"),
            numbers("heading_rad", error.heading_rad[keep], "rad", "between both, not negative"),
        ]
    if found is not None and found.changes is not None:
        files["changed_regions"] = _regions(post, window)
    if post.trials:
        files["trials"] = _trials(post)
    return files


def _path(track: PoseTrack, window: Window) -> list[Cells]:
    keep = window.holds(track.t_ns)
    frame = track.frame_id
    cells = [numbers("t_ns", track.t_ns[keep], "ns", _T)]
    for k, axis in enumerate(_AXES):
        unit = _UNITS[axis]
        cells.append(numbers(f"{axis}_{unit}", track.xyyaw[keep, k], unit, "of the base", frame))
    for a, b in combinations_with_replacement(range(3), 2):
        name = f"covariance_{_AXES[a]}_{_AXES[b]}"
        unit = f"{_UNITS[_AXES[a]]} {_UNITS[_AXES[b]]}"
        cells.append(numbers(name, track.cov[keep, a, b], unit, "about the frame's axes", frame))
    return cells


def _verdict(post: Postmortem) -> list[Cells]:
    judged, mode = post.judgement, post.judgement.failure_mode
    return [
        texts("state", [judged.state], "of the whole log"),
        numbers("confidence", _known([judged.confidence]), "1"),
        texts("failure_mode", [mode.kind]),
        numbers("failure_mode_confidence", _known([mode.confidence]), "1"),
        texts("summary", [judged.summary]),
    ]


def _intervals(post: Postmortem, window: Window) -> list[Cells]:
    rows = [
        i for i in post.judgement.intervals
        if i.start_ns <= window.end_ns and i.end_ns >= window.start_ns
    ]  # fmt: skip
    return [
        texts("state", [i.state for i in rows]),
        *_times([i.start_ns for i in rows], [i.end_ns for i in rows]),
        numbers("confidence", _known([i.confidence for i in rows]), "1"),
        numbers("max_error_m", _known([i.max_error_m for i in rows]), "m", "belief to hindsight"),
        numbers("max_error_rad", _known([i.max_error_rad for i in rows]), "rad"),
        texts("findings", [" ".join(i.findings) for i in rows], "ids that made the state"),
    ]


def _findings(rows: Sequence[Finding]) -> list[Cells]:
    told = [
        ("value", "the number that was judged; its unit stands beside it"),
        ("low", "of the interval it was judged by"),
        ("high", "of the interval it was judged by"),
        ("n", "samples"),
        ("n_eff", "effective samples"),
        ("p_value", "of data at least this odd from a consistent belief"),
        ("p_adjusted", "after Holm's correction over all tests of the log"),
    ]
    return [
        texts("id", [f.id for f in rows], "see `slamreplay explain`"),
        texts("severity", [f.severity for f in rows]),
        texts("title", [f.title for f in rows]),
        texts("message", [f.message for f in rows]),
        *_times([f.start_ns for f in rows], [f.end_ns for f in rows]),
        *(numbers(name, _known([getattr(f, name) for f in rows]), doc=doc) for name, doc in told),
        texts("unit", [f.unit for f in rows], "of value, low and high"),
    ]


def _regions(post: Postmortem, window: Window) -> list[Cells]:
    assert post.hindsight is not None
    assert post.hindsight.changes is not None
    rows = [
        r for r in post.hindsight.changes.regions
        if r.first_seen_ns <= window.end_ns and r.last_seen_ns >= window.start_ns
    ]  # fmt: skip
    sides = ("x_min_m", "y_min_m", "x_max_m", "y_max_m")
    frame = "map" if post.grid is None else post.grid.frame_id
    boxes = np.array([r.bbox_m for r in rows], dtype=np.float64).reshape(-1, 4)
    return [
        texts("kind", [r.kind for r in rows], "appeared, removed or moved"),
        *(numbers(side, boxes[:, k], "m", frame=frame) for k, side in enumerate(sides)),
        numbers("area_m2", [float(r.area_m2) for r in rows], "m^2"),
        *_times(
            [r.first_seen_ns for r in rows],
            [r.last_seen_ns for r in rows],
            ("first_seen_ns", "last_seen_ns"),
        ),
        numbers("views", np.array([r.views for r in rows], dtype=np.int64)),
        numbers("confidence", [float(r.confidence) for r in rows], "1"),
    ]


def _trials(post: Postmortem) -> list[Cells]:
    """One row a metric of a trial."""
    rows = [(t.run.trial, name, v) for t in post.trials for name, v in t.metrics.items()]
    return [
        texts("estimator", [t.estimator for t, *_ in rows]),
        texts("perturbation", [t.perturbation or "" for t, *_ in rows], "empty: undisturbed"),
        numbers("level", _known([t.level for t, *_ in rows]), doc="its unit stands beside it"),
        texts("unit", [t.unit for t, *_ in rows]),
        numbers("seed", np.array([t.seed for t, *_ in rows], dtype=np.int64)),
        texts("metric", [name for _, name, _ in rows], "its unit ends its name"),
        numbers("value", _known([v for *_, v in rows])),
    ]


def _touches(finding: Finding, window: Window) -> bool:
    start = window.start_ns if finding.start_ns is None else finding.start_ns
    end = start if finding.end_ns is None else finding.end_ns
    return start <= window.end_ns and end >= window.start_ns


def _known(values: Sequence[float | None]) -> np.ndarray:
    return np.array([np.nan if v is None else v for v in values], dtype=np.float64)


def _times(
    start: Sequence[int | None],
    end: Sequence[int | None],
    names: tuple[str, str] = ("start_ns", "end_ns"),
) -> list[Cells]:
    import pyarrow as pa

    return [
        Cells(name, pa.array(list(values), type=pa.int64()), "ns", doc=_T)
        for name, values in zip(names, (start, end), strict=True)
    ]
