"""The fleet's page on disk, and its questions as SQL beside it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

from slamreplay.bundle.atomic import write_file
from slamreplay.errors import MapError
from slamreplay.fleet.answering import answers as answers_of
from slamreplay.fleet.answers import Answers
from slamreplay.fleet.layout import PAGE_FILE, QUERIES_FILE, map_folder
from slamreplay.fleet.page.html import fleet_html
from slamreplay.fleet.page.map_image import MapImage, map_image
from slamreplay.fleet.page.view import versions_drawn, view_of
from slamreplay.fleet.queries import queries_sql
from slamreplay.maps.map_server import read_map


def write_fleet_page(
    folder: Path, answers: Answers | None = None, *, warn: Callable[[str], None] | None = None
) -> Path:
    """Write fleet.html and queries.sql into a batch's folder; each is whole, or stays as it was.

    Args:
        folder: of the batch; its `maps` are drawn, and its reports linked.
        answers: of its tables; None to find them.
        warn: told in one line of each map that cannot be read.

    Returns:
        The path of fleet.html.

    Raises:
        OutputError: the place cannot be written.
    """
    if answers is None:
        answers = answers_of(folder)
    images = _images(folder, versions_drawn(answers), warn or (lambda _line: None))
    write_file(folder / QUERIES_FILE, queries_sql(folder).encode())
    target = folder / PAGE_FILE
    write_file(target, fleet_html(view_of(answers, images)).encode())
    return target


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
