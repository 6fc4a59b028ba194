"""What slamreplay holds, as pandas DataFrames with the unit of every column in `attrs`."""

from __future__ import annotations

from collections.abc import Sequence
from types import UnionType
from typing import TYPE_CHECKING, Annotated, Any, Union, get_args, get_origin

if TYPE_CHECKING:
    import pandas as pd
    from pydantic import BaseModel

    from slamreplay.bundle.schema import Column
    from slamreplay.bundle.tables import Table
    from slamreplay.bundle.track import PoseTrack
    from slamreplay.evidence.scene import Lane

#: By the end of a column's name.
_UNITS = {"ns": "ns", "s": "s", "m": "m", "rad": "rad", "deg": "deg", "m2": "m^2", "hz": "Hz"}
_AXES = {"xyz": "xyz", "xyzw": "xyzw"}


def parts_frame(parts: Sequence[BaseModel], kind: type[BaseModel], start_ns: int) -> pd.DataFrame:
    """Objects of report.json as rows.

    Args:
        parts: all of one kind.
        kind: of them, for the columns of an empty frame.
        start_ns: of the log, that seconds are counted from.
    """
    import pandas as pd

    columns: dict[str, Any] = {}
    for name, field in kind.model_fields.items():
        values = [getattr(part, name) for part in parts]
        kinds = _kinds(field.annotation)
        if name.endswith("_ns"):  # nullable, for a float holds no nanoseconds
            columns[name] = pd.array(values, dtype="Int64")
            seconds = [None if v is None else (v - start_ns) / 1e9 for v in values]
            columns[f"{name[:-3]}_s"] = pd.Series(seconds, dtype="float64")
        else:  # None of a text stays None
            columns[name] = pd.Series(values, dtype=_dtype(kinds))
    return with_units(pd.DataFrame(columns))


def _kinds(annotation: Any) -> set[Any]:
    """Types of an annotation's values: of a union its parts, without the limits that they have."""
    if get_origin(annotation) is Annotated:
        return _kinds(get_args(annotation)[0])
    if get_origin(annotation) in (Union, UnionType):
        return set().union(*(_kinds(part) for part in get_args(annotation)))
    return {annotation}


def _dtype(kinds: set[Any]) -> str:
    """Of a column whose values are of these types."""
    if kinds <= {float, type(None)}:
        return "float64"
    if kinds <= {bool, type(None)}:
        return "boolean" if type(None) in kinds else "bool"
    if kinds <= {int, type(None)}:
        return "Int64" if type(None) in kinds else "int64"
    return "object"


def track_frame(track: PoseTrack, start_ns: int) -> pd.DataFrame:
    """A trajectory: a row a pose, with standard deviations and the whole covariance of x y yaw."""
    import numpy as np
    import pandas as pd

    columns: dict[str, Any] = {"t_ns": track.t_ns, "t_s": (track.t_ns - start_ns) / 1e9}
    axes = ("x_m", "y_m", "yaw_rad")
    columns |= {name: track.xyyaw[:, k] for k, name in enumerate(axes)}
    with np.errstate(invalid="ignore"):
        for k, name in enumerate(axes):
            columns[f"sigma_{name}"] = np.sqrt(track.cov[:, k, k])
    short = ("x", "y", "yaw")
    units = {}
    for i in range(3):
        for j in range(i, 3):
            name = f"cov_{short[i]}_{short[j]}"
            columns[name] = track.cov[:, i, j]
            units[name] = ("m^2", "m rad", "rad^2")[(i == 2) + (j == 2)]
    frame = with_units(pd.DataFrame(columns))
    frame.attrs["units"] |= units
    frame.attrs |= {"frame_id": track.frame_id, "child_frame_id": track.child_frame_id}
    return frame


def lanes_frame(lanes: Sequence[Lane], start_ns: int) -> pd.DataFrame:
    """Numbers over time, one below the other: a row a value, named by `lane`."""
    import numpy as np
    import pandas as pd

    def stacked(arrays: list[Any], dtype: Any) -> Any:
        return np.concatenate([np.empty(0, dtype), *arrays])

    lengths = [len(lane.t_ns) for lane in lanes]
    t_ns = stacked([lane.t_ns for lane in lanes], np.int64)
    frame = pd.DataFrame(
        {
            "lane": np.repeat(np.array([lane.key for lane in lanes], dtype=object), lengths),
            "t_ns": t_ns,
            "t_s": (t_ns - start_ns) / 1e9,
            "value": stacked([lane.values for lane in lanes], np.float64),
        }
    )
    frame.attrs["units"] = {
        "t_ns": "ns",
        "t_s": "s",
        "value": {x.key: x.unit or "1" for x in lanes},
    }
    frame.attrs["titles"] = {lane.key: lane.title for lane in lanes}
    frame.attrs["limits"] = {lane.key: lane.limit for lane in lanes}
    return frame


def table_frame(table: Table, start_ns: int) -> pd.DataFrame:
    """A table of a bundle as it was recorded, placeholders included.

    Vectors become a column for each axis, matrices a column of square arrays, lists a column of
    arrays. `attrs` has units, frames and docs by column.
    """
    import pandas as pd

    columns: dict[str, Any] = {}
    units, frames, docs = {}, {}, {}
    for column in table.schema.columns:
        for name, values in _spread(column, table[column.name]).items():
            columns[name] = values
            units[name], frames[name], docs[name] = column.unit, column.frame, column.doc
        if column.name == "t_ns":
            columns["t_s"] = (table.t_ns - start_ns) / 1e9
            units["t_s"], docs["t_s"] = "s", "seconds since the log's start"
    frame = pd.DataFrame(columns)
    frame.attrs |= {"table": table.schema.name, "doc": table.schema.doc, "units": units,
                    "frames": frames, "docs": docs}  # fmt: skip
    return frame


def _spread(column: Column, values: Any) -> dict[str, Any]:
    """A column of the schema as columns of a frame."""
    import numpy as np
    import pandas as pd

    from slamreplay.geometry.times import NO_STAMP

    name = column.name
    if column.kind.startswith("list_"):
        return {name: [values[row] for row in range(len(values))]}
    if column.size:
        stem, _, axes = name.rpartition("_")
        if axes in _AXES:
            return {f"{stem}_{axis}": values[:, k] for k, axis in enumerate(axes)}
        side = int(np.sqrt(column.size))
        return {name: list(values.reshape(-1, side, side))}
    if name == "t_sensor_ns":  # nullable, for a float holds no nanoseconds
        stamps = pd.array(values, dtype="Int64")
        stamps[values == NO_STAMP] = pd.NA
        return {name: stamps}
    return {name: values}


def with_units(frame: pd.DataFrame) -> pd.DataFrame:
    """The frame, told the units that its columns' names end in."""
    found = {
        str(c): _UNITS.get(str(c).rpartition("_")[2] if "_" in str(c) else "", "") for c in frame
    }
    frame.attrs["units"] = {name: unit for name, unit in found.items() if unit}
    return frame
