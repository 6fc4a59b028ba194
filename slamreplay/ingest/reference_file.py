"""Reference poses from a file: TUM (t x y z qx qy qz qw) or CSV with a header line."""

from __future__ import annotations

import re
from collections.abc import Sequence
from decimal import Decimal, InvalidOperation
from pathlib import Path

import numpy as np

from slamreplay.bundle.manifest import Loss
from slamreplay.errors import LogError
from slamreplay.geometry import se3
from slamreplay.geometry.times import NS_PER_S
from slamreplay.ingest.decoders.checks import kept, pose_rows
from slamreplay.ingest.rows import TopicRows

_TUM = ("t", "x", "y", "z", "qx", "qy", "qz", "qw")
#: Names of CSV columns, as tools write them.
_ALIASES = {"timestamp": "t", "time": "t", "stamp": "t", "t_s": "t", "t_ns": "t_ns",
            "timestamp_ns": "t_ns", "x_m": "x", "y_m": "y", "z_m": "z", "theta": "yaw",
            "yaw_rad": "yaw", "tx": "x", "ty": "y", "tz": "z"}  # fmt: skip


def read_reference(path: Path, frame_id: str, child: str) -> tuple[TopicRows, list[Loss]]:
    """Rows of table `references`, of kind survey.

    Args:
        path: TUM or CSV (columns t or t_ns, x, y, and yaw or qx qy qz qw; z may be missing).
        frame_id: the frame the poses are taken to be in.
        child: the frame that is posed.

    Raises:
        LogError: the file cannot be read, or a line in it makes no sense.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise LogError(f"cannot read the reference: {error}", where=path) from error
    names: Sequence[str] = _TUM
    t_ns: list[int] = []
    numbers: list[list[float]] = []
    for number, line in enumerate(text.splitlines(), start=1):
        cells = re.split(r"[,;\s]+", line.strip().rstrip(",;"))
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        if not numbers and not _is_number(cells[0]):
            names = [_ALIASES.get(c.strip('"').lower(), c.strip('"').lower()) for c in cells]
            _check_names(names, path)
            continue
        if len(cells) < len(names) or not all(_is_number(c) for c in cells[: len(names)]):
            raise LogError(
                f"line {number} is no pose", where=path, hint=f"expected: {' '.join(names)}"
            )
        row = dict(zip(names, cells, strict=False))
        t_ns.append(int(row["t_ns"]) if "t_ns" in row else _nanoseconds(row["t"]))
        numbers.append([float(row.get(n, "nan")) for n in ("x", "y", "z", "yaw", *_TUM[4:])])
    if not numbers:
        raise LogError("the reference holds no poses", where=path)
    return _rows(path, np.array(t_ns, dtype=np.int64), np.array(numbers), frame_id, child)


def _rows(
    path: Path, t_ns: np.ndarray, values: np.ndarray, frame_id: str, child: str
) -> tuple[TopicRows, list[Loss]]:
    yaw, quaternion = values[:, 3], values[:, 4:8]
    by_yaw = np.isfinite(yaw)[:, None]
    quaternion = np.where(by_yaw, se3.quaternion_from_yaw(yaw), quaternion)
    position = np.column_stack([values[:, :2], np.nan_to_num(values[:, 2], nan=0.0)])
    unit, keep, remarks = pose_rows(position, quaternion)
    n = len(t_ns)
    columns = {
        "frame_id": np.full(n, frame_id, dtype=object),
        "child_frame_id": np.full(n, child, dtype=object),
        "kind": np.full(n, "survey", dtype=object),
        "position_xyz": position,
        "orientation_xyzw": unit,
        "covariance": np.full((n, 36), np.nan),
    }
    decoded = kept(keep, columns, np.arange(n), t_ns, remarks)
    losses = [
        Loss(kind=r.kind, what=path.name, count=r.count, reason=r.reason)
        for r in remarks
        if r.count
    ]
    topic = TopicRows(path.name, "file", n, "references", decoded.columns, decoded.t_sensor_ns,
                      decoded.t_sensor_ns)  # fmt: skip
    return topic, losses


def _check_names(names: Sequence[str], path: Path) -> None:
    missing = {"x", "y"} - set(names)
    if not {"t", "t_ns"} & set(names):
        missing.add("t")
    if "yaw" not in names and not set(_TUM[4:]) <= set(names):
        missing.add("yaw or qx qy qz qw")
    if missing:
        raise LogError(f"the reference lacks {', '.join(sorted(missing))}", where=path)


def _is_number(text: str) -> bool:
    try:
        return Decimal(text) is not None
    except InvalidOperation:
        return False


def _nanoseconds(text: str) -> int:
    """Seconds as written to nanoseconds, never through a float."""
    return int((Decimal(text) * NS_PER_S).to_integral_value())
