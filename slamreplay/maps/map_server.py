"""Maps as map_server writes them: a yaml with metadata and a grey image, first row at the top.

The rules are nav2_map_server's (map_io.cpp): p = (255 - v) / 255, or v / 255 where `negate` is
set; occupied where p >= occupied_thresh, free where p <= free_thresh, else unknown; a pixel that
is not opaque is unknown; `scale` keeps the values between, `raw` takes the pixel as the cell.
"""

from __future__ import annotations

from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from slamreplay.errors import MapError
from slamreplay.maps.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid

MODES = ("trinary", "scale", "raw")
PIXEL_OCCUPIED, PIXEL_FREE, PIXEL_UNKNOWN = 0, 254, 205
#: Just under the 50 / 255 of an unknown pixel, which a threshold of 0.25 would read as free.
FREE_THRESH = 0.196


def read_map(yaml_path: Path, *, warn: Callable[[str], None]) -> OccupancyGrid:
    """The grid behind a map yaml, in frame `map`.

    Args:
        yaml_path: the yaml; its image is looked for relative to it, then beside it by name (yamls
            that were copied from another computer keep that computer's path).
        warn: told in one sentence about everything that was mended.

    Raises:
        MapError: the yaml or its image is missing, unreadable, or says impossible things.
    """
    meta = _read_meta(yaml_path)
    image_path = yaml_path.parent / str(meta["image"])
    beside = yaml_path.parent / image_path.name
    if not image_path.exists() and beside.exists():
        warn(f"{yaml_path.name} names an image elsewhere; took {beside.name} beside it")
        image_path = beside
    pixels, opaque = _read_image(image_path, yaml_path)
    mode = str(meta.get("mode", "trinary")).lower()
    if mode not in MODES:
        raise MapError(f"mode '{mode}' is none of {', '.join(MODES)}", where=yaml_path)
    try:
        origin = np.asarray(meta["origin"], dtype=np.float64).reshape(3)
        resolution = float(meta["resolution"])
        occupied_from, free_to = float(meta["occupied_thresh"]), float(meta["free_thresh"])
        negate = bool(int(meta.get("negate", 0)))
    except (TypeError, ValueError) as error:
        raise MapError(f"metadata is not numeric: {error}", where=yaml_path) from error
    if np.isnan(origin[2]):  # saved by a map_saver that was given a zero quaternion
        warn(f"{yaml_path.name} has a yaw of nan in its origin; took 0")
        origin[2] = 0.0
    if mode == "raw":
        cells = np.where(pixels <= OCCUPIED, pixels, UNKNOWN)
    else:
        p = pixels / 255.0 if negate else (255.0 - pixels) / 255.0
        between = np.full(pixels.shape, float(UNKNOWN))
        if mode == "scale":
            between = np.rint((p - free_to) / (occupied_from - free_to) * OCCUPIED)
        cells = np.where(p >= occupied_from, OCCUPIED, np.where(p <= free_to, FREE, between))
    cells = np.where(opaque, cells, UNKNOWN)
    return OccupancyGrid(np.flipud(cells).astype(np.int8), resolution, origin)


def map_files(grid: OccupancyGrid, stem: str) -> dict[str, bytes]:
    """File name to content of a map_server pair `STEM.yaml` and `STEM.pgm`, trinary."""
    pixels = np.full(grid.cells.shape, PIXEL_UNKNOWN, dtype=np.uint8)
    pixels[grid.occupied] = PIXEL_OCCUPIED
    pixels[grid.free] = PIXEL_FREE
    meta = {
        "image": f"{stem}.pgm",
        "mode": "trinary",
        "resolution": grid.resolution_m,
        "origin": grid.origin_xyyaw.tolist(),
        "negate": 0,
        "occupied_thresh": 0.65,
        "free_thresh": FREE_THRESH,
    }
    text = yaml.safe_dump(meta, sort_keys=False, default_flow_style=None)
    return {f"{stem}.yaml": text.encode(), f"{stem}.pgm": pgm(np.flipud(pixels))}


def pgm(pixels: NDArray[np.uint8]) -> bytes:
    """A binary PGM (P5) of pixels (H, W), first row at the top."""
    height, width = pixels.shape
    return b"P5\n%d %d\n255\n" % (width, height) + np.ascontiguousarray(pixels).tobytes()


def _read_meta(yaml_path: Path) -> dict[str, Any]:
    try:
        meta = yaml.safe_load(yaml_path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise MapError("no such map yaml", where=yaml_path) from error
    except UnicodeDecodeError as error:
        hint = "of a map give the yaml, which names the image"
        raise MapError("not a map yaml: it is no text", where=yaml_path, hint=hint) from error
    except (OSError, yaml.YAMLError) as error:
        problem = str(error).splitlines()[0]
        raise MapError(f"not a map yaml: {problem}", where=yaml_path) from error
    if not isinstance(meta, dict):
        raise MapError("not a map yaml: it holds no keys", where=yaml_path)
    # Maps saved by old tools lack the thresholds; these are map_server's own defaults.
    meta = {"occupied_thresh": 0.65, "free_thresh": FREE_THRESH, **meta}
    missing = [key for key in ("image", "resolution", "origin") if key not in meta]
    if missing:
        raise MapError(f"map yaml lacks {', '.join(missing)}", where=yaml_path)
    return meta


def _read_image(path: Path, yaml_path: Path) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    from PIL import (
        Image,
        UnidentifiedImageError,
    )  # slow to import, and only maps from files need it

    try:
        with Image.open(BytesIO(path.read_bytes())) as image:
            alpha = image.getchannel("A") if "A" in image.getbands() else None
            opaque = None if alpha is None else np.asarray(alpha) == 255
            pixels = np.asarray(image.convert("L"), dtype=np.float64)
    except FileNotFoundError as error:
        raise MapError(
            f"its image '{path.name}' is missing",
            where=yaml_path,
            hint="the path in 'image' is taken relative to the yaml",
        ) from error
    except (OSError, ValueError, UnidentifiedImageError, Image.DecompressionBombError) as error:
        raise MapError(
            f"its image '{path.name}' cannot be read: {error}", where=yaml_path
        ) from error
    return pixels, np.ones(pixels.shape, dtype=bool) if opaque is None else opaque
