"""Rows of points and of lines for Rerun: each row takes the place of the one before."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import ArrayLike, NDArray

from slamreplay.evidence.colours import rgb
from slamreplay.export.rerun.sink import Sink

Points = NDArray[np.float32]


def in_space(xy: ArrayLike, z_m: float = 0.0) -> Points:
    """(N, 3) points (N, 2) of the plane, drawn at a height: what is flat would hide each other."""
    points = np.asarray(xy, dtype=np.float32).reshape(-1, 2)
    return np.column_stack([points, np.full(len(points), z_m, dtype=np.float32)])


def closed(xy: ArrayLike, z_m: float = 0.0) -> Points:
    """The same of an outline, its first point once more at its end."""
    points = in_space(xy, z_m)
    return np.concatenate([points, points[:1]])


def rgba(hexadecimal: str) -> int:
    """A colour as Rerun packs it: 0xRRGGBBAA."""
    red, green, blue = rgb(hexadecimal)
    return red << 24 | green << 16 | blue << 8 | 255


def send_lines(
    sink: Sink,
    entity: str,
    t_ns: ArrayLike,
    rows: Sequence[Sequence[Points]],
    *,
    labels: Sequence[Sequence[str]] | None = None,
) -> None:
    """At each time (N,) its lines; a row without any takes away those before."""
    counts = [len(row) for row in rows]
    strips = [line for row in rows for line in row]
    columns = [*rr.LineStrips3D.columns(strips=strips).partition(counts)]
    if labels is not None:
        names = [name for row in labels for name in row]
        columns += rr.LineStrips3D.columns(labels=names).partition(counts)
    sink.send(entity, t_ns, columns)


def send_points(
    sink: Sink,
    entity: str,
    t_ns: ArrayLike,
    rows: Sequence[Points],
    *,
    colours: Sequence[NDArray[np.uint32]] | None = None,
    labels: Sequence[Sequence[str]] | None = None,
) -> None:
    """At each time (N,) its points, likewise."""
    counts = [len(row) for row in rows]
    columns = [*rr.Points3D.columns(positions=np.concatenate(rows)).partition(counts)]
    if colours is not None:
        columns += rr.Points3D.columns(colors=np.concatenate(colours)).partition(counts)
    if labels is not None:
        names = [name for row in labels for name in row]
        columns += rr.Points3D.columns(labels=names).partition(counts)
    sink.send(entity, t_ns, columns)


def line_look(colour: str, width: float) -> Any:
    """Colour and width, in points of the screen, of all lines of an entity."""
    return rr.LineStrips3D.from_fields(colors=[rgba(colour)], radii=_radius(width / 2.0))


def point_look(radius: float, colour: str | None = None) -> Any:
    """Radius, in points of the screen, and colour of all points of an entity."""
    look = {} if colour is None else {"colors": [rgba(colour)]}
    return rr.Points3D.from_fields(radii=_radius(radius), **look)


def _radius(points: float) -> Any:
    return [rr.components.Radius.ui_points(points)]
