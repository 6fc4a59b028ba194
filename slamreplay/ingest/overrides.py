"""What the user says about topics: the file behind `--topics`, read strictly."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path

import yaml

from slamreplay.bundle.role_tables import ROLE_TABLES
from slamreplay.errors import UsageError
from slamreplay.ingest.clouds.band import BAND_KEY
from slamreplay.ingest.placed_reference import PLACE_KEY, checked_place

#: Frames may be named too, where neither tf nor REP-105's names say which is which.
FRAME_KEYS = ("map_frame", "odom_frame", "base_frame")


def read_overrides(path: Path | None) -> dict[str, str]:
    """`role: topic`, `*_frame: frame` and what has a key of its own in a yaml, {} without one.

    Raises:
        UsageError: the file cannot be read, or has a key that is no role.
    """
    if path is None:
        return {}
    try:
        given = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        problem = str(error).splitlines()[0]
        raise UsageError(f"cannot read the topics file: {problem}", where=path) from error
    if given is None:
        return {}
    if not isinstance(given, dict):
        raise UsageError("a topics file holds lines of ROLE: TOPIC", where=path)
    keys = [*ROLE_TABLES, *FRAME_KEYS, BAND_KEY, PLACE_KEY]
    for key, value in given.items():
        if key not in keys:
            raise UsageError(f"there is no role '{key}'", where=path, hint=_nearest(str(key), keys))
        if key == BAND_KEY:
            given = {**given, key: _band(value, path)}
        elif key == PLACE_KEY:
            given = {**given, key: checked_place(value, path)}
        elif not isinstance(value, str) or not value:
            raise UsageError(f"the value of '{key}' is no name", where=path)
    return {str(k): str(v) for k, v in given.items()}


def _band(value: object, path: Path) -> str:
    """Two heights above the floor, m, as text."""
    numbers = value if isinstance(value, list) else []
    if [type(n) in (int, float) for n in numbers] != [True, True] or not numbers[0] < numbers[1]:
        raise UsageError(
            f"'{BAND_KEY}' takes two heights above the floor", where=path, hint="as in [0.2, 1.0]"
        )
    return f"{numbers[0]:g} {numbers[1]:g}"


def check_topics(overrides: Mapping[str, str], topics: Sequence[str], path: Path | None) -> None:
    """Raise UsageError where an override names a topic that the log has no usable rows of."""
    for role, topic in overrides.items():
        if role in ROLE_TABLES and topic not in topics:
            raise UsageError(
                f"there is no topic '{topic}' to play {role}",
                where=path,
                hint=_nearest(topic, sorted(topics)),
            )


def _nearest(name: str, names: Sequence[str]) -> str:
    near = get_close_matches(name, names, n=1)
    return f"did you mean '{near[0]}'?" if near else f"there are: {', '.join(names)}"
