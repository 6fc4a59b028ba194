"""The fleet's page on disk."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

from slamreplay.bundle.atomic import write_file
from slamreplay.errors import MapError
from slamreplay.fleet.page.html import fleet_html
from slamreplay.fleet.page.map_image import MapImage, map_image
from slamreplay.fleet.page.view import versions_drawn, view_of
from slamreplay.maps.map_server import read_map

PAGE_FILE = "fleet.html"


def write_fleet_page(folder: Path, *, warn: Callable[[str], None] | None = None) -> Path:
    """Write fleet.html of the tables and maps in a batch's folder; whole or as it was.

    Args:
        folder: of the batch, with `tables` and `maps` as `store` and the batch leave them.
        warn: told in one line of each part or map that cannot be read.

    Returns:
        Its path.

    Raises:
        OutputError: the place cannot be written.
    """
