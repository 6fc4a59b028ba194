"""Reference poses from a file: TUM, TUM with OpenVINS's covariance, or CSV with a header line."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.manifest import Loss
from slamreplay.errors import LogError
from slamreplay.geometry import se3
from slamreplay.geometry.covariance import ros_from_openvins, ros_from_planar
from slamreplay.geometry.times import Times, from_decimal_seconds
from slamreplay.ingest.decoders.checks import kept, pose_rows
from slamreplay.ingest.decoders.decoder import Remark
from slamreplay.ingest.rows import TopicRows
from slamreplay.ingest.text_logs.numbers import table_of_numbers

_TUM = ("t", "x", "y", "z", "qx", "qy", "qz", "qw")
#: What ov_eval's recorder writes after a pose: upper triangles, rotation first.
_UPPER = ("11", "12", "13", "22", "23", "33")
_BLOCKS = ("pr", "pt")
_OPENVINS = tuple(f"{block}{ij}" for block in _BLOCKS for ij in _UPPER)
#: Upper triangle of x y yaw, about the axes of the frame the poses are in.
_PLANAR = ("cov_xx", "cov_xy", "cov_xyaw", "cov_yy", "cov_yyaw", "cov_yawyaw")
#: Names of CSV columns, as tools write them.
_ALIASES = {"timestamp": "t", "time": "t", "stamp": "t", "t_s": "t", "t_ns": "t_ns",
            "timestamp(s)": "t", "timestamp_ns": "t_ns", "x_m": "x", "y_m": "y", "z_m": "z",
            "theta": "yaw", "yaw_rad": "yaw", "tx": "x", "ty": "y", "tz": "z"}  # fmt: skip


@dataclass(frozen=True)
class _Line:
    """One line with its number in the file."""

    number: int
    cells: list[str]


def read_reference(path: Path, frame_id: str, child: str) -> tuple[TopicRows, list[Loss]]:
    """Rows of table `references`, of kind survey.

    Args:
        path: TUM (t x y z qx qy qz qw, in some lines followed by OpenVINS's Pr11 to Pt33), or CSV
            with columns t or t_ns, x, y, and yaw or qx qy qz qw; z may be missing, and covariances
            may be there as Pr11 to Pt33, or as cov_xx, cov_yy and cov_yawyaw with cov_xy, cov_xyaw
            and cov_yyaw zero where they are missing.
        frame_id: the frame the poses are taken to be in.
        child: the frame that is posed.

    Raises:
        LogError: the file cannot be read, or a line in it makes no sense.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        hint = "TUM or CSV is expected"
        raise LogError(f"cannot read the reference: {error}", where=path, hint=hint) from error
    lines = [
        _Line(number, re.split(r"[,;\s]+", line.strip().rstrip(",;")))
        for number, line in enumerate(text.splitlines(), start=1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    has_header = bool(lines) and not _is_number(lines[0].cells[0])
    names = _names(lines[0], path) if has_header else (*_TUM, *_OPENVINS)
    lines = lines[1:] if has_header else lines
    if not lines:
        hint = "lines of t x y z qx qy qz qw, or a header line and lines below it"
        raise LogError("the reference holds no poses", where=path, hint=hint)
    _check_widths(lines, names if has_header else None, path)
    t_ns = _times(lines, names, path)
    return _rows(path, t_ns, _values(lines, names, path), frame_id, child)


def _names(header: _Line, path: Path) -> tuple[str, ...]:
    """Names of the columns of a header line."""
    names = [c.strip('"').lower() for c in header.cells]
    names = [_ALIASES.get(name, name) for name in names]
    missing = [name for name in ("x", "y") if name not in names]
    missing += [] if {"t", "t_ns"} & set(names) else ["t"]
    if "yaw" not in names and not set(_TUM[4:]) <= set(names):
        missing.append("yaw or qx qy qz qw")
    for family, needed in ((_OPENVINS, _OPENVINS), (_PLANAR, (_PLANAR[0], _PLANAR[3], _PLANAR[5]))):
        if set(family) & set(names):
            missing += [name for name in needed if name not in names]
    where = f"{path}, line {header.number}"
    if missing:
        hint = f"the header names: {' '.join(header.cells)}"
        raise LogError(f"the reference lacks {', '.join(missing)}", where=where, hint=hint)
    used = {*_TUM, *_OPENVINS, *_PLANAR, "yaw", "t_ns"}
    twice = sorted({name for name in names if name in used and names.count(name) > 1})
    if twice:
        hint = "leave one of them out"
        raise LogError(f"two columns are {', '.join(twice)}", where=where, hint=hint)
    return tuple(names)


def _check_widths(lines: Sequence[_Line], names: Sequence[str] | None, path: Path) -> None:
    """Raise LogError at the first line with a wrong number of columns (`names` of a header)."""
    allowed = (len(_TUM), len(_TUM) + len(_OPENVINS)) if names is None else (len(names),)
    hint = f"expected: {' '.join(_TUM)}, alone or with the 12 numbers Pr11 to Pt33 of OpenVINS"
    if names is not None:
        hint = f"the header names {len(names)}: {' '.join(names)}"
    for line in lines:
        if len(line.cells) not in allowed:
            what = f"{len(line.cells)} columns are no pose"
            raise LogError(what, where=f"{path}, line {line.number}", hint=hint)


def _times(lines: Sequence[_Line], names: Sequence[str], path: Path) -> Times:
    column = names.index("t_ns" if "t_ns" in names else "t")
    texts = [line.cells[column] for line in lines]
    if names[column] == "t_ns":
        whole = [_whole(text) for text in texts]
        is_time = np.array([value is not None for value in whole])
        t_ns = np.array([value or 0 for value in whole], dtype=np.int64)
        unit, hint = "whole nanoseconds", "a column of seconds is called t"
    else:
        t_ns, is_time = from_decimal_seconds([text.encode() for text in texts])
        unit, hint = "seconds", "a column of nanoseconds is called t_ns, in a header line"
    if not is_time.all():
        row = int(np.argmin(is_time))
        where = f"{path}, line {lines[row].number}"
        raise LogError(f"'{texts[row]}' is no time in {unit}", where=where, hint=hint)
    return t_ns


def _values(
    lines: Sequence[_Line], names: Sequence[str], path: Path
) -> dict[str, NDArray[np.float64]]:
    """Numbers (N,) of every column of use but the time; NaN where a line has none."""
    wanted = [i for i, n in enumerate(names) if n in {*_TUM[1:], *_OPENVINS, *_PLANAR, "yaw"}]
    rows = [[c[i] if i < len(c) else "nan" for i in wanted] for c in (x.cells for x in lines)]
    values, sound = table_of_numbers([" ".join(row).encode() for row in rows], len(wanted))
    if not sound.all():
        row = int(np.argmin(sound))
        i = next(i for i, cell in enumerate(rows[row]) if not _is_float(cell))
        where = f"{path}, line {lines[row].number}"
        hint = f"column {wanted[i] + 1} is {names[wanted[i]]}"
        raise LogError(f"'{rows[row][i]}' is no number", where=where, hint=hint)
    return {names[i]: values[:, k] for k, i in enumerate(wanted)}


def _rows(
    path: Path, t_ns: Times, values: dict[str, NDArray[np.float64]], frame_id: str, child: str
) -> tuple[TopicRows, list[Loss]]:
    n = len(t_ns)
    nothing = np.full(n, np.nan)
    quaternion = np.column_stack([values.get(name, nothing) for name in _TUM[4:]])
    if "yaw" in values:
        quaternion = se3.quaternion_from_yaw(values["yaw"])
    z = np.nan_to_num(values.get("z", np.zeros(n)), nan=0.0)
    position = np.column_stack([values["x"], values["y"], z])
    unit, keep, remarks = pose_rows(position, quaternion)
    covariance, odd = _covariance(values, unit)
    columns = {
        "frame_id": np.full(n, frame_id, dtype=object),
        "child_frame_id": np.full(n, child, dtype=object),
        "kind": np.full(n, "survey", dtype=object),
        "position_xyz": position,
        "orientation_xyzw": unit,
        "covariance": covariance,
    }
    remarks = (*remarks, odd)
    decoded = kept(keep, columns, np.arange(n), t_ns, remarks)
    losses = [
        Loss(kind=r.kind, what=path.name, count=r.count, reason=r.reason)
        for r in remarks
        if r.count
    ]
    topic = TopicRows(path.name, "file", n, "references", decoded.columns, decoded.t_sensor_ns,
                      decoded.t_sensor_ns)  # fmt: skip
    return topic, losses


def _covariance(
    values: dict[str, NDArray[np.float64]], orientation_xyzw: NDArray[np.float64]
) -> tuple[NDArray[np.float64], Remark]:
    """(N, 36) as ROS orders it, NaN where none is told, and how many were told that are none."""
    n = len(orientation_xyzw)
    out = np.full((n, 36), np.nan)
    if "pr11" in values:
        rotation, position = (_symmetric([values[f"{p}{ij}"] for ij in _UPPER]) for p in _BLOCKS)
        blocks = [rotation, position]
        R = se3.rotation_matrix(orientation_xyzw)
        out = ros_from_openvins(rotation, position, R).reshape(n, 36)
    elif "cov_xx" in values:
        zero = np.zeros(n)
        blocks = [_symmetric([values.get(name, zero) for name in _PLANAR])]
        out = ros_from_planar(blocks[0])
    else:
        return out, Remark("lost", 0, "")
    told = np.all([np.isfinite(block).all(axis=(1, 2)) for block in blocks], axis=0)
    sound, is_zero = told.copy(), told.copy()
    for block in blocks:
        full = np.where(told[:, None, None], block, 0.0)
        size = np.abs(full).max(axis=(1, 2), initial=0.0)
        sound &= np.linalg.eigvalsh(full)[:, 0] >= -1e-9 * size
        is_zero &= size == 0.0
    sound &= ~is_zero  # recorders write zeros before the first covariance has come
    out[~sound] = np.nan
    reason = "a covariance that is zero or has a negative variance: taken as none"
    return out, Remark("lost", int((told & ~sound).sum()), reason)


def _symmetric(upper: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """(N, 3, 3) of upper triangles, row by row."""
    a, b, c, d, e, f = upper
    return np.stack([np.stack(r, axis=-1) for r in ((a, b, c), (b, d, e), (c, e, f))], axis=-2)


def _is_number(text: str) -> bool:
    try:
        return Decimal(text) is not None
    except InvalidOperation:
        return False


def _is_float(text: str) -> bool:
    return bool(table_of_numbers([text.encode()], 1)[1][0])


def _whole(text: str) -> int | None:
    """A whole number that int64 holds, or None."""
    try:
        value = Decimal(text)
    except InvalidOperation:
        return None
    if not value.is_finite() or abs(value) >= 2**63 or value != value.to_integral_value():
        return None
    return int(value)
