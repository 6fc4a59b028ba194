"""sensor_msgs/PointCloud2: bytes under a layout that each message brings along."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slamreplay.geometry.times import Times
from slamreplay.ingest.decoders.decoder import Messages

#: sensor_msgs/PointField datatypes.
_DTYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
#: How drivers call the time of a point, in lower case: Velodyne; Ouster; Hesai, RoboSense and
#: Livox; Nebula; converted Livox clouds; Aeva; and what else is about.
_TIMES = ("time", "t", "timestamp", "time_stamp", "offset_time", "time_offset_ns", "time_offset",
          "point_time_offset", "point_time", "timestamps", "ts")  # fmt: skip

#: Name of a field to its offset in bytes and its datatype.
_Fields = Mapping[str, tuple[int, int]]


@dataclass(frozen=True, eq=False)
class Clouds:
    """N clouds of one topic, their points one after the other, P in all.

    Attributes:
        xyz: (3, P) float32 m in the sensor's frame; NaN where nothing came back.
        time: (P,) as recorded, in whatever unit, NaN in clouds without it; None where none has it.
        offsets: (N + 1,) first point of each cloud.
        rows: (N,) rows of an organised cloud; 1 of a heap of points.
        frame_id: (N,) names, without leading slash.
        t_sensor_ns: (N,) header stamps, NO_STAMP where there is none.
        t_log_ns: (N,) log times.
        index: (N,) the message that each came from.
        lost: messages without x, y and z, or with fewer bytes than they say.
    """

    xyz: NDArray[np.float32]
    time: NDArray[np.float64] | None
    offsets: NDArray[np.int64]
    rows: NDArray[np.int64]
    frame_id: NDArray[Any]
    t_sensor_ns: Times
    t_log_ns: Times
    index: NDArray[np.int64]
    lost: int = 0

    def __len__(self) -> int:
        return len(self.offsets) - 1

    @property
    def owner(self) -> NDArray[np.int64]:
        """(P,) the cloud that each point is in."""
        return np.repeat(np.arange(len(self)), np.diff(self.offsets))

    def take(self, index: NDArray[np.int64]) -> Clouds:
        """The clouds at an index array."""
        offsets = np.concatenate([[0], np.cumsum(np.diff(self.offsets)[index])]).astype(np.int64)
        pieces = [slice(*self.offsets[k : k + 2]) for k in index]
        points = (
            np.concatenate([self.xyz[:, p] for p in pieces], axis=1) if pieces else self.xyz[:, :0]
        )
        time = None
        if self.time is not None:
            time = np.concatenate([self.time[p] for p in pieces]) if pieces else self.time[:0]
        return replace(
            self,
            xyz=points,
            time=time,
            offsets=offsets,
            rows=self.rows[index],
            frame_id=self.frame_id[index],
            t_sensor_ns=self.t_sensor_ns[index],
            t_log_ns=self.t_log_ns[index],
            index=self.index[index],
        )


def clouds_of(messages: Messages) -> Clouds:
    """The points of PointCloud2 messages, whatever their layout."""
    height, width, row_step, step = (
        messages.column(name, np.int64) for name in ("height", "width", "row_step", "point_step")
    )
    data = messages.ragged("data", np.uint8)
    layout_of, layouts = _layouts(messages, step)
    in_row = np.where(height > 1, row_step, width * step)
    needed = np.maximum(height - 1.0, 0.0) * in_row + width * step  # a float cannot wrap
    fits = ((height == 0) | (needed <= data.lengths)) & (in_row >= width * step)
    count = np.where(fits, height, 0) * width
    readable = fits & np.array([layouts[k] is not None for k in layout_of], dtype=bool)
    kept = np.flatnonzero(readable)
    offsets = np.concatenate([[0], np.cumsum(count[kept])]).astype(np.int64)
    xyz = np.empty((3, offsets[-1]), dtype=np.float32)
    has_time = any(layout is not None and "time" in (layout.names or ()) for layout in layouts)
    time = np.full(offsets[-1], np.nan) if has_time else None
    is_dense = (in_row == width * step) & (data.lengths == count * step)
    for first, last in _runs(kept, layout_of, is_dense):
        whole, layout = kept[first], layouts[layout_of[kept[first]]]
        raw = data.values[data.offsets[whole] : data.offsets[kept[last - 1] + 1]]
        points = slice(offsets[first], offsets[last])
        if is_dense[whole]:
            cells = raw.view(layout)
        else:
            shape, strides = (height[whole], width[whole]), (in_row[whole], step[whole])
            cells = np.ndarray(shape, layout, raw, strides=strides).ravel()
        with np.errstate(over="ignore", invalid="ignore"):
            for axis, name in enumerate("xyz"):
                xyz[axis, points] = cells[name]
            if time is not None and "time" in (cells.dtype.names or ()):
                time[points] = cells["time"]
    _without_returns(xyz)
    stamps = messages.stamps()[kept]
    return Clouds(xyz, time, offsets, height[kept], messages.frames()[kept], stamps,
                  messages.t_log_ns[kept], kept, len(messages) - len(kept))  # fmt: skip


def _without_returns(xyz: NDArray[np.float32]) -> None:
    """NaN for points that are none: not finite, or 0 0 0 as Ouster and Gazebo write it."""
    with np.errstate(invalid="ignore", over="ignore"):
        size = np.abs(xyz).sum(axis=0)
    xyz[:, ~(np.isfinite(size) & (size > 0.0))] = np.nan


def _runs(
    kept: NDArray[np.int64], layout_of: NDArray[np.int64], is_dense: NDArray[np.bool_]
) -> Iterator[tuple[int, int]]:
    """[first, last) of kept messages that follow each other and can be read as one piece."""
    if not len(kept):
        return
    before, after = kept[:-1], kept[1:]
    joined = (after == before + 1) & (layout_of[after] == layout_of[before])
    joined &= is_dense[after] & is_dense[before]
    starts = np.append(0, np.flatnonzero(~joined) + 1)
    yield from zip(starts.tolist(), [*starts[1:].tolist(), len(kept)], strict=True)


def _layouts(
    messages: Messages, step: NDArray[np.int64]
) -> tuple[NDArray[np.int64], list[np.dtype[Any] | None]]:
    """(N,) which layout a message has, and the layouts; None of one without x, y and z."""
    fields, owner = messages.children("fields")
    names = fields.texts("name").astype(str)
    offset, kind = fields.column("offset", np.int64), fields.column("datatype", np.int64)
    many = np.bincount(owner, minlength=len(messages))
    place = np.arange(len(owner)) - (np.cumsum(many) - many)[owner]
    said = np.full((len(messages), 3, int(many.max(initial=0))), -1, dtype=np.int64)
    said[owner, :, place] = np.column_stack(
        [np.unique(names, return_inverse=True)[1], offset, kind]
    )
    big = messages.column("is_bigendian", bool)
    keys = np.column_stack([said.reshape(len(messages), 3 * said.shape[2]), big, step])
    _, first, layout_of = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    layouts = []
    for k in first.tolist():
        own = np.flatnonzero(owner == k)
        found = {str(names[i]).lower(): (int(offset[i]), int(kind[i])) for i in own}
        layouts.append(_layout(found, ">" if big[k] else "<", int(step[k])))
    return np.ravel(layout_of), layouts


def _layout(fields: _Fields, order: str, step: int) -> np.dtype[Any] | None:
    """Where x, y, z and the time of a point stand; a time that cannot be is left out."""
    time = next((name for name in _TIMES if name in fields), "")
    for wanted in ({"x": "x", "y": "y", "z": "z", "time": time}, {"x": "x", "y": "y", "z": "z"}):
        try:
            return np.dtype(
                {
                    "names": list(wanted),
                    "formats": [order + _DTYPES[fields[name][1]] for name in wanted.values()],
                    "offsets": [fields[name][0] for name in wanted.values()],
                    "itemsize": step,
                }
            )
        except (KeyError, TypeError, ValueError):
            continue
    return None
