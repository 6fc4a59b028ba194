"""The contract: the belief that a motion or recovery was built on, and what of it was missing.

A pose alone is no interface: frame, time, covariance, map version and consumer travel with it. What
the log does not tell of these, or what was stale when it was acted on, is a finding.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.belief import arrival_ns
from slamreplay.bundle.findings import Finding
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.geometry.times import NS_PER_S
from slamreplay.verdict.judgement import Action, Consumed
from slamreplay.verdict.limits import Limits

#: A localizer that speaks only when the robot moved is stale only if it has moved this much since.
MOVED_M, MOVED_RAD = 0.5, np.radians(30.0)


class Contract:
    """What was known to the planner over a log.

    Args:
        view: the log.
        belief: base in map as believed, with its covariance; None where no localizer spoke.
        limits: how old is stale.
    """

    def __init__(self, view: BundleView, belief: PoseTrack | None, limits: Limits) -> None:
        self._view, self._belief, self._limits = view, belief, limits
        self._said, self._on_motion, self._always = _said_at(view)
        updates = view.table("map_updates").sorted_by_time()
        self._map_t, self._maps = updates.t_ns, updates["map_version"].astype(str)

    def at(self, t_ns: int, consumer: str) -> Consumed:
        """The belief that held at a time on the bundle's clock, for `consumer`."""
        lacks = []
        version = self._map_version(t_ns)
        if version is None:
            lacks.append("map version unknown")
        belief = self._belief
        row = -1 if belief is None else _last(belief.t_ns[belief.has_pose], t_ns)
        if belief is None or row < 0:
            return Consumed(None, None, None, None, version, consumer, ("no belief", *lacks))
        before = int(np.searchsorted(self._said, t_ns, side="right")) - 1
        said = int(self._said[before]) if before >= 0 else None
        age = None if said is None or self._always else max(t_ns - said, 0) / NS_PER_S
        if age is not None and said is not None and age > self._limits.stale_s:
            if not self._on_motion or self._moved(said, t_ns):
                lacks.insert(0, f"{age:.1f} s old")
        elif said is None and not self._always:
            lacks.insert(0, "time unknown")
        sigma = _sigma(belief, t_ns)
        if sigma is None:
            lacks.append("no covariance")
        return Consumed(belief.frame_id, said, age, sigma, version, consumer, tuple(lacks))

    def _map_version(self, t_ns: int) -> str | None:
        if not len(self._maps):
            return None
        row = int(np.searchsorted(self._map_t, t_ns, side="right")) - 1
        # A latched map is recorded when the recorder joins: the first one held before that, too.
        return str(self._maps[max(row, 0)]) or None

    def _moved(self, since_ns: int, t_ns: int) -> bool:
        if self._belief is None:
            return False
        pair = self._belief.at(np.array([since_ns, t_ns])).xyyaw
        if not np.isfinite(pair).all():
            return True
        turn = abs(np.arctan2(np.sin(pair[1, 2] - pair[0, 2]), np.cos(pair[1, 2] - pair[0, 2])))
        return bool(np.hypot(*(pair[1] - pair[0])[:2]) > MOVED_M or turn > MOVED_RAD)


def contract_findings(actions: tuple[Action, ...]) -> tuple[Finding, ...]:
    """SR-ACT-003: beliefs that were acted on although something of them was missing or stale."""
    told = [a for a in actions if a.belief is not None and not a.inferred]
    short = [a for a in told if a.belief is not None and a.belief.lacks]
    if not short:
        return ()
    kinds: dict[str, int] = {}
    oldest = 0.0
    for action in short:
        for lack in () if action.belief is None else action.belief.lacks:
            stale = lack.endswith(" s old")
            name = "stale" if stale else lack
            oldest = max(oldest, float(lack.split()[0])) if stale else oldest
            kinds[name] = kinds.get(name, 0) + 1
    grave = "stale" in kinds or "no belief" in kinds
    parts = [
        f"{name} (up to {oldest:.1f} s old): {n}" if name == "stale" else f"{name}: {n}"
        for name, n in sorted(kinds.items())
    ]
    text = f"{len(short)} of {len(told)} actions consumed an incomplete belief: {', '.join(parts)}"
    return (
        Finding(
            "SR-ACT-003",
            "warning" if grave else "info",
            text,
            short[0].t_ns,
            short[-1].t_ns,
            value=len(short) / len(told),
            low=0.0,
            high=0.0,
            unit="ratio",
            n=len(told),
        ),
    )


def _said_at(view: BundleView) -> tuple[NDArray[np.int64], bool, bool]:
    """When the localizer's words arrived (sorted), whether it speaks on motion only, or always."""
    frames = view.manifest.frames
    if frames.map and frames.odom:
        table = view.table("transforms")
        parents, children = table["parent_frame"], table["child_frame"]
        rows = (parents == frames.map) & (children == frames.odom)
        rows |= (parents == frames.odom) & (children == frames.map)
        if rows.any():
            always = bool(table["is_static"][rows].all())
            return np.sort(arrival_ns(view, table["t_log_ns"][rows])), False, always
    table_ = view.role("pose")
    if table_ is None or not len(table_):
        return np.zeros(0, dtype=np.int64), True, False
    return np.sort(np.maximum(arrival_ns(view, table_["t_log_ns"]), table_.t_ns)), True, False


def _last(t: NDArray[np.int64], t_ns: int) -> int:
    return int(np.searchsorted(np.sort(t), t_ns, side="right")) - 1


def _sigma(belief: PoseTrack, t_ns: int) -> tuple[float, float, float] | None:
    given = np.isfinite(belief.cov).all(axis=(1, 2)) & (belief.t_ns <= t_ns)
    rows = np.flatnonzero(given)
    if not len(rows):
        return None
    variance = np.diag(belief.cov[rows[np.argmax(belief.t_ns[rows])]])
    if (variance < 0.0).any():
        return None
    x, y, yaw = np.sqrt(variance).tolist()
    return x, y, yaw
