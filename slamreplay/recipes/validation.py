"""What a recipe says against what it may say: the first fault in one line, with the nearest key."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from slamreplay.errors import UsageError
from slamreplay.registry import nearest

Model = TypeVar("Model", bound=BaseModel)


def validated(model: type[Model], given: Mapping[str, Any], path: Path, under: str = "") -> Model:
    """The values as a model that forbids what it does not know.

    Args:
        model: with `extra="forbid"` and `strict=True`.
        given: plain values.
        path: the file they are from, for the error.
        under: the key they stand under in it.

    Raises:
        UsageError: a key that is not known, missing, or has a value that makes no sense.
    """
    try:
        return model.model_validate(dict(given))
    except ValidationError as error:
        # A misspelt key is also a missing one: the spelling is what the user can mend.
        misspelt = [f for f in error.errors() if f["type"] == "extra_forbidden"]
        faults = misspelt or error.errors()
        what, hint = _told(faults[0], model, under)
        more = f", and {len(faults) - 1} more" if len(faults) > 1 else ""
        raise UsageError(what + more, where=path, hint=hint) from error


def one_line(key: str, text: str, path: Path) -> None:
    """Refuse a text that is printed as a line and is none.

    Raises:
        UsageError: it has line breaks, or blanks that would not be seen.
    """
    if " ".join(text.split()) != text:
        raise UsageError(f"'{key}' is not one line of text", where=path)


def unknown_key(key: str, keys: Iterable[str]) -> tuple[str, str]:
    """What is wrong with a key that there is not, and the nearest there is."""
    return f"there is no key {key[:80]!r}", nearest(key.rpartition(".")[2], sorted(keys))


def _told(fault: ErrorDetails, model: type[BaseModel], under: str) -> tuple[str, str | None]:
    """What is wrong, and what could be done about it."""
    key = ".".join(map(str, (under, *fault["loc"]) if under else fault["loc"]))
    if fault["type"] == "extra_forbidden":
        return unknown_key(key, _keys(_model_at(model, fault["loc"][:-1])))
    key = key if key.isprintable() else repr(key)[1:-1]  # a key of the user's own
    if fault["type"] == "missing":
        return f"the key '{key}' is missing", None
    message = fault["msg"].removeprefix("Value error, ").removeprefix("Input ")
    if isinstance(fault["input"], dict | list):  # rules across keys: there is no one value to show
        return f"'{key}': {message}" if key else message, None
    shown = repr(fault["input"])
    shown = shown if len(shown) <= 40 else shown[:37] + "..."
    return f"'{key}' is {shown}: it {message}", None


def _model_at(model: type[BaseModel], where: Sequence[int | str]) -> type[BaseModel]:
    """The model that holds the key at a place: down the fields, through lists and unions."""
    for name in where:
        field = _keys(model).get(str(name))
        if field is not None:  # else the index of a list
            model = _inner_model(field.annotation) or model
    return model


def _keys(model: type[BaseModel]) -> dict[str, FieldInfo]:
    """Fields by the key that they have in a file."""
    return {field.alias or name: field for name, field in model.model_fields.items()}


def _inner_model(annotation: Any) -> type[BaseModel] | None:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next((m for a in get_args(annotation) if (m := _inner_model(a))), None)
