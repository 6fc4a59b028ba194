"""Parameters as a file gives them, checked and turned into a frozen dataclass."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any, Literal, TypeVar, get_args, get_origin, get_type_hints

from slamreplay.errors import UsageError
from slamreplay.registry import nearest

Settings = TypeVar("Settings")

#: How ROS 2 reads plain words as truth values (rcl_yaml_param_parser, parse.c).
_TRUE = frozenset(("true", "yes", "y", "on"))
_FALSE = frozenset(("false", "no", "n", "off"))


def settings_from(
    cls: type[Settings], given: Mapping[str, object], *, where: str, known: tuple[str, ...] = ()
) -> Settings:
    """A frozen dataclass with the fields that were given; the others keep their defaults.

    A field may be a float (an integer will do), an int (so will 2000.0), a bool, a str, or a
    Literal of texts.

    Args:
        cls: the dataclass.
        given: values by field name.
        where: whose parameters they are, for errors.
        known: further names that the user may mean, for the hint on a misspelt one.

    Raises:
        UsageError: a name that is no field, or a value that the field cannot take: what is wrong,
            with the nearest name or what is allowed.
    """
    types = get_type_hints(cls)
    names = [item.name for item in fields(cls)]  # type: ignore[arg-type]
    values = {}
    for name, value in given.items():
        if name not in names:
            raise unknown_parameter(name, (*names, *known), where)
        values[name] = _value(types[name], name, value, where)
    return cls(**values)


def unknown_parameter(name: str, names: tuple[str, ...], where: str) -> UsageError:
    """The error for a parameter that there is not, with the nearest that there is."""
    return UsageError(
        f"there is no parameter '{name[:80]}'", where=where, hint=nearest(name, sorted(set(names)))
    )


def _value(kind: Any, name: str, value: Any, where: str) -> object:
    if get_origin(kind) is Literal:
        if value in get_args(kind):
            return value
        raise _unfit(name, value, "one of " + ", ".join(map(str, get_args(kind))), where)
    if kind is bool:
        word = str(value).lower()
        if isinstance(value, bool) or word in _TRUE | _FALSE:
            return value if isinstance(value, bool) else word in _TRUE
        raise _unfit(name, value, "true or false", where)
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if kind is float and is_number:
        return float(value)
    if kind is int and is_number and float(value).is_integer():
        return int(value)
    if kind is str and isinstance(value, str):
        return value
    what = {float: "a number", int: "a whole number", str: "a text"}
    raise _unfit(name, value, what[kind], where)


def _unfit(name: str, value: object, allowed: str, where: str) -> UsageError:
    shown = repr(value)
    shown = shown if len(shown) <= 40 else shown[:37] + "..."
    return UsageError(f"'{name}' is {shown}: it should be {allowed}", where=where)
