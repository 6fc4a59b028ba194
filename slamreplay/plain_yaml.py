"""YAML as plain data: texts, numbers, lists and keys; nothing that builds, repeats or surprises."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml

from slamreplay.errors import UsageError

#: A page of settings; more is another file, or an attack.
MAX_BYTES, MAX_DEPTH = 100_000, 20

# Scalars of YAML 1.2's core schema (section 10.3.2), without octal and hexadecimal numbers. PyYAML
# itself reads YAML 1.1, where 1e-3 is a text, `no` is false and 1:30 is ninety.
_WORDS = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL")),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
}
_INTEGER = re.compile(r"[-+]?[0-9]{1,18}")
_NUMBER = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_NOT_FINITE = re.compile(r"[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)")


def read_plain_yaml(
    path: Path, *, kind: str, hint: str, max_bytes: int = MAX_BYTES
) -> dict[str, Any]:
    """The keys of a YAML file that holds one mapping.

    Aliases (a few lines of them can stand for gigabytes), tags and keys given twice are refused.

    Args:
        path: the file.
        kind: what it is, for errors: "recipe".
        hint: how such a file begins, for one that holds no mapping.
        max_bytes: more than this is no such file.

    Raises:
        UsageError: the file cannot be read, is no such YAML, or is too large.
    """
    text = _text(path, kind, max_bytes)
    try:
        given = _document(yaml.parse(text, Loader=yaml.SafeLoader))
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = f"line {mark.line + 1}: " if mark else ""
        raise UsageError(f"{line}{error.problem or error.context}", where=path) from error
    except yaml.YAMLError as error:
        raise UsageError(f"not YAML: {str(error).splitlines()[0]}", where=path) from error
    if not isinstance(given, dict):
        raise UsageError(f"a {kind} holds lines of KEY: VALUE", where=path, hint=hint)
    return given


def _text(path: Path, kind: str, max_bytes: int) -> str:
    try:
        if path.exists() and not path.is_file():  # a pipe would wait for ever
            raise UsageError("not a file", where=path, hint=f"name the {kind}.yaml itself")
        with path.open("rb") as stream:
            content = stream.read(max_bytes + 1)
    except (OSError, ValueError) as error:  # ValueError: a zero byte in the name
        why = getattr(error, "strerror", None) or error
        raise UsageError(f"cannot read the {kind}: {why}", where=path) from error
    if len(content) > max_bytes:
        raise UsageError(f"larger than {max_bytes} bytes, so not a {kind}", where=path)
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise UsageError("not a text in UTF-8", where=path) from error


def _document(events: Iterator[yaml.Event]) -> Any:
    """The value of the only document; None of an empty file."""
    given = None
    documents = 0
    for event in events:
        if isinstance(event, yaml.DocumentStartEvent):
            documents += 1
            if documents > 1:
                raise _refused("a second document begins", event)
            given = _value(next(events), events, 0)
    return given


def _value(event: yaml.Event, events: Iterator[yaml.Event], depth: int) -> Any:
    """The value that an event begins, as deep as it goes."""
    if isinstance(event, yaml.AliasEvent):
        raise _refused("aliases (*name) are not read here, write the value itself", event)
    tag = getattr(event, "tag", None)
    if tag is not None:
        raise _refused(f"tags ({tag[:40]}) are not read here", event)
    if depth > MAX_DEPTH:
        raise _refused(f"nested more than {MAX_DEPTH} deep", event)
    if isinstance(event, yaml.ScalarEvent):
        return _scalar(event.value) if event.implicit[0] else event.value
    if isinstance(event, yaml.SequenceStartEvent):
        out: list[Any] = []
        while not isinstance(event := next(events), yaml.SequenceEndEvent):
            out.append(_value(event, events, depth + 1))
        return out
    return _mapping(events, depth)


def _mapping(events: Iterator[yaml.Event], depth: int) -> dict[str, Any]:
    """What stands up to the end of a mapping: keys that are texts, each given once."""
    out: dict[str, Any] = {}
    while not isinstance(event := next(events), yaml.MappingEndEvent):
        key = _value(event, events, depth + 1)
        if not isinstance(key, str):
            raise _refused("a key must be a text", event)
        if key in out:
            raise _refused(f"the key {key[:40]!r} is given twice", event)
        out[key] = _value(next(events), events, depth + 1)
    return out


def _scalar(text: str) -> Any:
    """A plain scalar: null, true, false, a number, or else the text itself."""
    if text in _WORDS:
        return _WORDS[text]
    if _INTEGER.fullmatch(text):
        return int(text)
    if _NUMBER.fullmatch(text):
        return float(text)
    if _NOT_FINITE.fullmatch(text):
        return float(text.lower().replace(".", ""))
    return text


def _refused(problem: str, event: yaml.Event) -> yaml.MarkedYAMLError:
    mark: Any = event.start_mark
    return yaml.MarkedYAMLError(problem=problem, problem_mark=mark)
