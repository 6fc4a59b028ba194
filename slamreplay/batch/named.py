"""The small files that a log is read with, carried along to whoever reads it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path, PurePosixPath

import yaml

from slamreplay.batch.addresses import name_of, shown
from slamreplay.batch.small_files import NotThereError, read_small
from slamreplay.batch.task import LogSource
from slamreplay.errors import MapError, SlamreplayError

MAP, TOPICS = "map", "topics"
#: A text of settings, and the image of a map, B: 20 000 x 20 000 cells as a grey image are 400 MB,
#: as a png far less.
_TEXT, _IMAGE = 1_000_000, 64_000_000


def named_files(source: LogSource, storage: Mapping[str, object]) -> dict[str, bytes]:
    """The map's yaml with its image and the topics file of a source, by path (`placed`).

    Raises:
        MapError: the map's yaml or its image cannot be read or is too large.
        UsageError: the topics file cannot.
    """
    found: dict[str, bytes] = {}
    if source.map is not None:
        found |= _map_files(source.map, storage)
    if source.topics is not None:
        content = read_small(source.topics, storage, most=_TEXT)
        found[f"{TOPICS}/{_plain_name(source.topics)}"] = content
    return found


def placed(named: Mapping[str, bytes], folder: Path) -> tuple[Path | None, Path | None]:
    """Write the files below a folder; paths of the map's yaml and of the topics file.

    Raises:
        OSError: the folder takes no files.
    """
    found: dict[str, Path] = {}
    for name, content in named.items():
        target = folder / name
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(content)
        found.setdefault(name.partition("/")[0], target)  # the yaml comes before its image
    return found.get(MAP), found.get(TOPICS)


def _map_files(place: str, storage: Mapping[str, object]) -> dict[str, bytes]:
    try:
        content = read_small(place, storage, most=_TEXT)
    except SlamreplayError as error:
        raise MapError(f"the map: {error.what}", where=error.where, hint=error.hint) from error
    name = _plain_name(place)
    try:
        meta = yaml.safe_load(content)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise MapError("not a map yaml", where=shown(place),
                       hint="of a map give the yaml, which names the image") from error  # fmt: skip
    if not isinstance(meta, dict) or not isinstance(meta.get("image"), str):
        raise MapError("map yaml lacks image", where=shown(place))
    image = _image(place, meta["image"], storage)
    plain = _plain_name(meta["image"])
    if plain == name:
        plain = f"image-{plain}"
    if meta["image"] != plain:  # elsewhere: beside the yaml from now on
        content = yaml.safe_dump({**meta, "image": plain}, sort_keys=False).encode()
    return {f"{MAP}/{name}": content, f"{MAP}/{plain}": image}


def _image(place: str, image: str, storage: Mapping[str, object]) -> bytes:
    """Relative to the yaml, then beside it by name, as of `maps.map_server.read_map`."""
    folder = place.rpartition("/")[0]
    start = f"{folder}/" if folder or place.startswith("/") else ""
    beside = start + image.rpartition("/")[2]
    first = image if image.startswith("/") else start + image
    places = [beside] if image.startswith("/") and "://" in place else [first, beside]
    for at in places:
        try:
            return read_small(at, storage, most=_IMAGE)
        except NotThereError:
            continue
        except SlamreplayError as error:
            raise MapError(f"its image: {error.what}", where=shown(place)) from error
    raise MapError(
        f"its image '{name_of(image)[:80]}' is missing", where=shown(place),
        hint="the path in 'image' is taken relative to the yaml",
    )  # fmt: skip


def _plain_name(place: str) -> str:
    """A name that any file system takes below a folder."""
    name = PurePosixPath(name_of(place)).name
    return name if name not in ("", ".", "..") else "unnamed"
