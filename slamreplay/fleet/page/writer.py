"""The fleet's page on disk."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

from slamreplay.bundle.atomic import write_file
from slamreplay.errors import MapError
from slamreplay.fleet.answering import answers as answers_of
from slamreplay.fleet.answers import Answers
from slamreplay.fleet.page.html import fleet_html
from slamreplay.fleet.page.map_image import MapImage, map_image
from slamreplay.fleet.page.view import versions_drawn, view_of
from slamreplay.maps.map_server import read_map

PAGE_FILE = "fleet.html"


def write_fleet_page(
    folder: Path, answers: Answers | None = None, *, warn: Callable[[str], None] | None = None
) -> Path:
    """Write fleet.html into a batch's folder; it is whole, or stays as it was.

    Args:
        folder: of the batch; its `maps` are drawn, and its reports linked.
        answers: of its tables; None to find them.
        warn: told in one line of each map that cannot be read.

    Returns:
        Its path.

    Raises:
        OutputError: the place cannot be written.
    """
    if answers is None:
        answers = answers_of(folder)
    images = _images(folder, versions_drawn(answers), warn or (lambda _line: None))
    target = folder / PAGE_FILE
    write_file(target, fleet_html(view_of(answers, images, {})).encode())
    return target


def map_folder(version: str) -> str:
    """Where a map is, from the batch's folder."""
    return f"maps/{version.removeprefix('sha256:')[:16]}"


def _images(
    folder: Path, versions: Iterable[str], warn: Callable[[str], None]
) -> dict[str, MapImage]:
    """Of the maps that are there; a log without a map of its own leaves none."""
    found = {}
    for version in versions:
        yaml = folder / map_folder(version) / "map.yaml"
        if not yaml.exists():
            continue
        try:
            image = map_image(read_map(yaml, warn=warn))
        except MapError as error:
            warn(str(error))
            continue
        if image is not None:
            found[version] = image
    return found
