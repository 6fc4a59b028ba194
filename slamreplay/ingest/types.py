"""What a connection's type looks like, from its own definition or from those that ship here."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import TYPE_CHECKING, Any

from slamreplay.errors import LogError
from slamreplay.ingest.readers.reader import Connection
from slamreplay.ingest.wire.layout import Struct, UnknownLayoutError, layout_of
from slamreplay.messages.definitions import DEFINITIONS
from slamreplay.messages.interfaces import as_message, message_definition
from slamreplay.messages.layouts import layouts as shipped_layouts

if TYPE_CHECKING:
    from rosbags.interfaces.typing import Typesdict

_TIME = "builtin_interfaces/msg/Time"
_DURATION = "builtin_interfaces/msg/Duration"


def layouts(connection: Connection) -> list[Struct]:
    """What a connection's messages may look like on the wire, in the order to try them.

    The log's own definition wins, and is read apart from all others, so that two layouts of one
    type in one log do not meet. Without one, ROS 2's types and `slamreplay.messages` are used, in
    every layout that a type has had, the newest first.

    Raises:
        LogError: the type has no (readable) definition.
    """
    name, encoding = as_message(connection.type), connection.encoding
    own = message_definition(connection.type, connection.definition)
    form = connection.definition_format
    try:
        if own:
            return [layout_of(name, _own(encoding, name, form, own), encoding)]
        if name in _store(encoding):
            return [layout_of(name, _with_needed({}, name, encoding), encoding)]
        known = [_own(encoding, name, "msg", t) for t in shipped_layouts(connection.type)]
        found = [layout_of(name, definitions, encoding) for definitions in known]
    except UnknownLayoutError as error:
        raise LogError(f"its definition cannot be used: {error}") from error
    if not found:
        raise LogError("the log has no definition of this type, and neither do we")
    return found


def shipped(name: str, encoding: str) -> Mapping[str, Any] | None:
    """Definitions of a type and those in it that need no log, by name; None of an unknown type."""
    if _shipped(name, encoding) is None:
        return None
    return _with_needed({}, name, encoding)


@cache
def _own(encoding: str, name: str, form: str, text: str) -> Mapping[str, Any]:
    from rosbags.typesys import get_types_from_idl, get_types_from_msg

    try:
        found = get_types_from_idl(text) if form == "idl" else get_types_from_msg(text, name)
    except Exception as error:  # a parser of foreign text fails in many ways
        raise LogError(f"its definition cannot be read: {str(error).splitlines()[0]}") from error
    return _with_needed(found, name, encoding)


def _with_needed(found: Typesdict, name: str, encoding: str) -> Mapping[str, Any]:
    """Definitions with those that fields of theirs need and that are not among them.

    Recorders leave out builtin_interfaces, and odd bags even std_msgs/Header.
    """
    whole: dict[str, Any] = dict(found)
    needed = {name, *_needed(whole)}
    while missing := sorted(needed - set(whole)):
        for kind in missing:
            shipped = _shipped(kind, encoding)
            if shipped is None:
                raise UnknownLayoutError(f"{kind} is not defined")
            whole[kind] = shipped
        needed = _needed(whole)
    return whole


@cache
def _shipped(name: str, encoding: str) -> Any:
    """(constants, fields) of a type that rosbags or `slamreplay.messages` knows, or None."""
    from rosbags.interfaces import Nodetype
    from rosbags.typesys import get_types_from_msg

    if name in (_TIME, _DURATION):  # before the stores, which take a while to load
        seconds = "uint32" if encoding == "ros1" and name == _TIME else "int32"
        rest = "uint32" if name == _TIME or encoding != "ros1" else "int32"
        fields = [("sec", seconds), ("nanosec", rest)]
        return [], [(field, (Nodetype.BASE, (kind, 0))) for field, kind in fields]
    if (known := _store(encoding).get(name)) is not None:
        return known
    text = DEFINITIONS.get(name)
    return None if text is None else get_types_from_msg(text, name)[name]


@cache
def _store(encoding: str) -> Mapping[str, Any]:
    from rosbags.typesys import Stores, get_typestore

    kind = Stores.ROS1_NOETIC if encoding == "ros1" else Stores.ROS2_HUMBLE
    return get_typestore(kind).fielddefs


def _needed(definitions: Mapping[str, Any]) -> set[str]:
    """Names of the types that fields of these definitions have."""
    from rosbags.interfaces import Nodetype

    names = set()
    for _, fields in definitions.values():
        for _, (kind, args) in fields:
            inner = args[0] if kind in {Nodetype.ARRAY, Nodetype.SEQUENCE} else (kind, args)
            if isinstance(inner, tuple) and inner[0] == Nodetype.NAME:
                names.add(str(inner[1]))
    return names
