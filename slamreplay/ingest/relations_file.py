"""Relations between two moments from a file: what a person measured, pair by pair.

The benchmark of Kuemmerle et al. (On measuring the accuracy of SLAM algorithms, Autonomous Robots
27, 2009, 387-407) gives no trajectory but the motion from one scan to another, for pairs of scans
that were laid onto each other by hand.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from slamreplay.bundle.manifest import Loss
from slamreplay.errors import LogError
from slamreplay.geometry import se3
from slamreplay.geometry.times import Times, from_decimal_seconds
from slamreplay.ingest.rows import TopicRows
from slamreplay.ingest.text_logs.numbers import table_of_numbers

SUFFIX = ".relations"
_NAMES = "t1 t2 x y z roll pitch yaw"
#: Stamps of a pair are those of two scans; what is farther from every scan is of another log.
NEAR_NS = 1_000_000


def read_relations(
    path: Path, child: str, scans_sensor_ns: Times, scans_t_ns: Times
) -> tuple[TopicRows, Times, list[Loss]]:
    """Rows of table `relations`, their times on the bundle's clock, and what was left out.

    Args:
        path: lines of t1 t2 x y z roll pitch yaw: the robot's pose at t2 in its frame at t1, times
            in s as the scans are stamped, m and rad; lines that begin with # are comments.
        child: the robot's frame.
        scans_sensor_ns: (N,) stamps of the scans.
        scans_t_ns: (N,) their times on the bundle's clock.

    Raises:
        LogError: the file cannot be read, a line in it makes no sense, or no pair is of this log.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise LogError(f"cannot read the relations: {error}", where=path) from error
    lines = [
        (number, line.split())
        for number, line in enumerate(text.splitlines(), start=1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    for number, cells in lines:
        if len(cells) != len(_NAMES.split()):
            what = f"{len(cells)} columns are no relation"
            raise LogError(what, where=f"{path}, line {number}", hint=f"expected: {_NAMES}")
    first, second = (from_decimal_seconds([c[k].encode() for _, c in lines]) for k in (0, 1))
    values, sound = table_of_numbers([" ".join(c[2:]).encode() for _, c in lines], 6)
    sound &= first[1] & second[1] & np.isfinite(values).all(axis=1)
    if not sound.all():
        where = f"{path}, line {lines[int(np.argmin(sound))][0]}"
        raise LogError("times or numbers that are none", where=where, hint=f"expected: {_NAMES}")
    near = _nearest(scans_sensor_ns, first[0]), _nearest(scans_sensor_ns, second[0])
    off = [np.abs(scans_sensor_ns[n] - t[0]) for n, t in zip(near, (first, second), strict=True)]
    kept = (np.maximum(*off) <= NEAR_NS) if len(lines) else np.zeros(0, dtype=bool)
    if not kept.any():
        hint = "each pair names two scans by their header stamps, in s"
        raise LogError("no relation is between two scans of this log", where=path, hint=hint)
    losses = []
    if not kept.all():
        reason = "relations of moments at which there is no scan"
        losses.append(Loss(kind="skipped", what=path.name, count=int((~kept).sum()), reason=reason))
    count = int(kept.sum())
    roll, pitch, yaw = values[kept, 3:].T
    columns = {
        "child_frame_id": np.full(count, child, dtype=object),
        "t2_sensor_ns": scans_sensor_ns[near[1][kept]],
        "position_xyz": values[kept, :3],
        "orientation_xyzw": se3.quaternion_from_rpy(roll, pitch, yaw),
    }
    stamps = scans_sensor_ns[near[0][kept]]
    rows = TopicRows(path.name, "file", len(lines), "relations", columns, stamps, stamps)
    return rows, scans_t_ns[near[0][kept]], losses


def _nearest(stamps: Times, asked: Times) -> Times:
    """(M,) row of the stamp (of N in any order) that is nearest to each of the asked (M,)."""
    if not len(stamps):
        return np.zeros(len(asked), dtype=np.int64)
    order = np.argsort(stamps, kind="stable")
    high = np.clip(np.searchsorted(stamps[order], asked), 1, max(len(stamps) - 1, 1))
    high = np.minimum(high, len(stamps) - 1)
    low = np.maximum(high - 1, 0)
    nearer = np.abs(stamps[order[low]] - asked) <= np.abs(stamps[order[high]] - asked)
    return np.asarray(order[np.where(nearer, low, high)])
