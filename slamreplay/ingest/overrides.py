"""What the user says about topics: the file behind `--topics`, read strictly."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path

import yaml

from slamreplay.bundle.view import ROLE_TABLES
from slamreplay.errors import UsageError

#: Frames may be named too, where neither tf nor REP-105's names say which is which.
FRAME_KEYS = ("map_frame", "odom_frame", "base_frame")


def read_overrides(path: Path | None) -> dict[str, str]:
    """`role: topic` and `*_frame: frame` of a yaml, {} without one.

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
    keys = [*ROLE_TABLES, *FRAME_KEYS]
    for key, value in given.items():
        if key not in keys:
            raise UsageError(f"there is no role '{key}'", where=path, hint=_nearest(str(key), keys))
        if not isinstance(value, str) or not value:
            raise UsageError(f"the value of '{key}' is no name", where=path)
    return {str(k): str(v) for k, v in given.items()}


def check_topics(overrides: Mapping[str, str], topics: Sequence[str], path: Path | None) -> None:
    """Raise UsageError where an override names a topic that the log has no usable rows of."""
    for role, topic in overrides.items():
        if role not in FRAME_KEYS and topic not in topics:
            raise UsageError(
                f"there is no topic '{topic}' to play {role}",
                where=path,
                hint=_nearest(topic, sorted(topics)),
            )


def _nearest(name: str, names: Sequence[str]) -> str:
    near = get_close_matches(name, names, n=1)
    return f"did you mean '{near[0]}'?" if near else f"there are: {', '.join(names)}"
