"""What a connection's type looks like, from its own definition or from those that ship here."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import TYPE_CHECKING, Any

from slamreplay.errors import LogError
from slamreplay.ingest.readers.reader import Connection
from slamreplay.ingest.wire.layout import Struct, UnknownLayoutError, layout_of
from slamreplay.messages.definitions import DEFINITIONS, LATER_DEFINITIONS
from slamreplay.messages.services import as_message, event_definition

if TYPE_CHECKING:
    from rosbags.interfaces.typing import Typesdict

_TIME = "builtin_interfaces/msg/Time"
_DURATION = "builtin_interfaces/msg/Duration"


def layouts(connection: Connection) -> list[Struct]:
    """What a connection's messages may look like on the wire, the likeliest first.

    The log's own definition wins, and is read apart from all others, so that two layouts of one
    type in one log do not meet. Without one, ROS 2's types and `slamreplay.messages` are used, in
    every layout that a type has had.

    Raises:
        LogError: the type has no (readable) definition.
    """
    name, encoding = as_message(connection.type), connection.encoding
    text = event_definition(connection.type, connection.definition)
    try:
        if text:
            own = _own(encoding, name, connection.definition_format, text)
            return [layout_of(name, own)]
        found = [
            layout_of(name, _with_needed({}, name, encoding, later=later))
            for later in (False, True)
            if _shipped(name, encoding, later=later) is not None
        ]
    except UnknownLayoutError as error:
        raise LogError(f"its definition cannot be used: {error}") from error
    if not found:
        raise LogError("the log has no definition of this type, and neither do we")
    return found if found[0] != found[-1] else found[:1]


def shipped(name: str, encoding: str) -> Mapping[str, Any] | None:
    """Definitions of a type and those in it that need no log, by name; None of an unknown type."""
    if _shipped(name, encoding, later=False) is None:
        return None
    return _with_needed({}, name, encoding, later=False)


@cache
def _own(encoding: str, name: str, form: str, text: str) -> Mapping[str, Any]:
    from rosbags.typesys import get_types_from_idl, get_types_from_msg

    try:
        found = get_types_from_idl(text) if form == "idl" else get_types_from_msg(text, name)
    except Exception as error:  # a parser of foreign text fails in many ways
        raise LogError(f"its definition cannot be read: {str(error).splitlines()[0]}") from error
    return _with_needed(found, name, encoding, later=False)


def _with_needed(found: Typesdict, name: str, encoding: str, *, later: bool) -> Mapping[str, Any]:
    """Definitions with those that fields of theirs need and that are not among them.

    Recorders leave out builtin_interfaces, and odd bags even std_msgs/Header.
    """
    whole: dict[str, Any] = dict(found)
    needed = {name, *_needed(whole)}
    while missing := sorted(needed - set(whole)):
        for kind in missing:
            shipped = _shipped(kind, encoding, later=later)
            if shipped is None:
                raise UnknownLayoutError(f"{kind} is not defined")
            whole[kind] = shipped
        needed = _needed(whole)
    return whole


@cache
def _shipped(name: str, encoding: str, *, later: bool) -> Any:
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
    texts = DEFINITIONS | LATER_DEFINITIONS if later else DEFINITIONS
    return get_types_from_msg(texts[name], name)[name] if name in texts else None


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
