"""A map as a small image for a page, and how it lies in the map's frame."""

from __future__ import annotations

import base64
import io
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.geometry import se2
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.report.replay.ground import ground_of

#: By a cell's code (unknown, free, wall): grey and opacity. Both are seen on light and dark paper,
#: and what is drawn below shines through where a robot can drive.
_GREYS = ((128, 60), (128, 0), (120, 255))


@dataclass(frozen=True)
class MapImage:
    """An image of the part of a map that says anything.

    Attributes:
        uri: the image as a data address (PNG).
        width: in pixels, as is `height`.
        height: of it.
        transform: SVG's, from the image's pixels (y down) to the map's frame (m, y up).
        box_m: (x_min, y_min, x_max, y_max) around the image in the map's frame.
    """

    uri: str
    width: int
    height: int
    transform: str
    box_m: tuple[float, float, float, float]


def map_image(grid: OccupancyGrid) -> MapImage | None:
    """The image of a map; None of one in which nothing is known.

    A grid that is turned in its frame is an image that is turned by its transform.
    """
    ground = ground_of(grid, None)
    if ground is None:
        return None
    height, width = ground.codes.shape
    x, y, yaw = ground.origin_xyyaw
    corners = np.array(ground.corner) + ground.cell_m * np.array(
        [[0, 0], [width, 0], [0, height], [width, height]]
    )
    around = se2.transform_points(np.array(ground.origin_xyyaw), corners)
    low, high = around.min(axis=0), around.max(axis=0)
    steps = (
        f"translate({x:.6g} {y:.6g})",
        f"rotate({np.degrees(yaw):.6g})",
        f"translate({ground.corner[0]:.6g} {ground.corner[1]:.6g})",
        f"scale({ground.cell_m:.6g} {-ground.cell_m:.6g})",
        f"translate(0 {-height})",
    )
    uri = f"data:image/png;base64,{base64.b64encode(_png(np.flipud(ground.codes))).decode()}"
    box = (float(low[0]), float(low[1]), float(high[0]), float(high[1]))
    return MapImage(uri, width, height, " ".join(steps), box)


def _png(codes: NDArray[np.uint8]) -> bytes:
    """Codes (H, W), first row at the top, two bits a pixel."""
    from PIL import Image  # slow to import, and `--help` needs none

    image = Image.fromarray(codes)
    image.putpalette([grey for grey, _ in _GREYS for _ in range(3)])
    out = io.BytesIO()
    opacity = bytes(opacity for _, opacity in _GREYS)
    image.save(out, "PNG", optimize=True, bits=2, transparency=opacity)
    return out.getvalue()
