"""A corrected map: the one that was driven with, and what the log saw of it otherwise."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path

import numpy as np
import yaml
from numpy.typing import NDArray

from slamreplay.bundle.products import Changes
from slamreplay.errors import OutputError, UsageError
from slamreplay.maps.grid import FREE, OCCUPIED, OccupancyGrid
from slamreplay.maps.map_server import PIXEL_FREE, PIXEL_OCCUPIED, map_files, pgm, read_map

#: The first line of a proposal; a file without it is somebody else's and is never overwritten.
_OURS = "# map corrected by slamreplay: a proposal, look at it before you drive with it\n"


def corrections(grid: OccupancyGrid, changes: Changes) -> tuple[NDArray, NDArray]:
    """(H, W) cells that are to be walls, and cells that are to be free: only such as were seen.

    Of what changed during the log the last state counts.
    """
    now = grid.cells if changes.corrected is None else changes.corrected
    changed = now != grid.cells
    return changed & (now == OCCUPIED), changed & (now == FREE)


def proposal_files(
    grid: OccupancyGrid, changes: Changes | None, stem: str, original: Path | None
) -> dict[str, bytes]:
    """File name to content of `STEM.yaml` and `STEM.pgm`.

    Args:
        grid: the map.
        changes: what of it was not true; None changes nothing.
        stem: the files' name.
        original: the map's own yaml, if it is at hand: mode, thresholds, origin and every pixel
            that was not seen to be otherwise are kept as they are there. Without it the map is
            written trinary with map_server's thresholds.
    """
    if changes is None:
        occupied = free = np.zeros(grid.cells.shape, dtype=bool)
    else:
        occupied, free = corrections(grid, changes)
    kept = None if original is None else _edited(original, grid, occupied, free)
    if kept is None:
        cells = np.where(occupied, OCCUPIED, np.where(free, FREE, grid.cells)).astype(np.int8)
        corrected = OccupancyGrid(cells, grid.resolution_m, grid.origin_xyyaw, grid.frame_id)
        files = map_files(corrected, stem)
        return {**files, f"{stem}.yaml": _OURS.encode() + files[f"{stem}.yaml"]}
    meta, pixels = kept
    text = yaml.safe_dump(
        {**meta, "image": f"{stem}.pgm"}, sort_keys=False, default_flow_style=None
    )
    return {f"{stem}.yaml": (_OURS + text).encode(), f"{stem}.pgm": pgm(pixels)}


def _edited(
    original: Path, grid: OccupancyGrid, occupied: NDArray, free: NDArray
) -> tuple[dict[str, object], NDArray[np.uint8]] | None:
    """The yaml's keys and the image's pixels after the correction; None if it is another map."""
    from PIL import Image

    if read_map(original, warn=lambda _text: None).cells.shape != grid.cells.shape:
        return None
    meta = yaml.safe_load(original.read_text(encoding="utf-8"))
    path = original.parent / str(meta["image"])
    path = path if path.exists() else original.parent / path.name
    with Image.open(BytesIO(path.read_bytes())) as image:
        if "A" in image.getbands():
            return None  # a PGM cannot say what is transparent
        pixels = np.asarray(image.convert("L"), dtype=np.uint8).copy()
    wall, empty = PIXEL_OCCUPIED, PIXEL_FREE
    if str(meta.get("mode", "trinary")).lower() == "raw":
        wall, empty = OCCUPIED, FREE
    elif int(meta.get("negate", 0)):
        wall, empty = 255 - PIXEL_OCCUPIED, 255 - PIXEL_FREE
    pixels[np.flipud(occupied)], pixels[np.flipud(free)] = wall, empty
    return meta, pixels


def check_proposal_target(target: Path) -> None:
    """Refuse a place for the proposal before any work is spent on it.

    Raises:
        UsageError: not the name of a yaml.
        OutputError: a file is there that is not a proposal of ours, or the folder is missing.
    """
    if target.suffix not in (".yaml", ".yml"):
        raise UsageError("the corrected map needs a name that ends in .yaml", where=target)
    if not target.parent.is_dir():
        raise OutputError("no such folder", where=target.parent)
    try:
        is_ours = target.read_text(encoding="utf-8").startswith(_OURS) if target.exists() else None
    except (OSError, UnicodeDecodeError):
        is_ours = False
    if is_ours is False or (is_ours is None and target.with_suffix(".pgm").exists()):
        raise OutputError(
            "there is a map already that is not a proposal of ours",
            where=target,
            hint="give a new name: a map is never overwritten",
        )


def write_proposal(
    grid: OccupancyGrid, changes: Changes | None, target: Path, original: Path | None
) -> None:
    """Write the corrected map to `target` and the image beside it.

    Raises:
        OutputError: it cannot be written.
    """
    check_proposal_target(target)
    try:
        for name, content in proposal_files(grid, changes, target.stem, original).items():
            into = target if name.endswith(".yaml") else target.with_name(name)
            work = into.with_name(f".{into.name}.part")
            work.write_bytes(content)
            work.replace(into)
    except OSError as error:
        raise OutputError(f"cannot be written: {error.strerror}", where=target) from error
