"""What a connection's type looks like, from its own definition or from those that ship here."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

from slamreplay.errors import LogError
from slamreplay.ingest.readers.reader import Connection
from slamreplay.ingest.wire.layout import Struct, UnknownLayoutError, layout_of
from slamreplay.messages.definitions import DEFINITIONS, LATER_DEFINITIONS

if TYPE_CHECKING:
    from rosbags.interfaces.typing import Typesdict
    from rosbags.typesys.store import Typestore


def layouts(connection: Connection) -> list[Struct]:
    """What a connection's messages may look like on the wire, the likeliest first.

    The log's own definition wins; each definition has a store of its own, so that two layouts of
    one type in one log do not meet. Without one, ROS 2's types and `slamreplay.messages` are used,
    in every layout that a type has had.

    Raises:
        LogError: the encoding is unknown here, or the type has no (readable) definition.
    """
    if connection.encoding not in {"ros1", "cdr"}:
        raise LogError(f"messages are encoded as '{connection.encoding or 'unknown'}'")
    name = connection.type
    try:
        if connection.definition:
            form, text = connection.definition_format, connection.definition
            return [layout_of(name, _store(connection.encoding, name, form, text).fielddefs)]
        stores = [_shipped(connection.encoding), _shipped(connection.encoding, later=True)]
        found = [layout_of(name, s.fielddefs) for s in stores if name in s.fielddefs]
    except UnknownLayoutError as error:
        raise LogError(f"its definition cannot be used: {error}") from error
    if not found:
        raise LogError("the log has no definition of this type, and neither do we")
    return found if found[0] != found[-1] else found[:1]


@cache
def _store(encoding: str, name: str, form: str, text: str) -> Typestore:
    from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

    store = get_typestore(Stores.EMPTY)
    shipped = _shipped(encoding).fielddefs
    try:
        found = get_types_from_idl(text) if form == "idl" else get_types_from_msg(text, name)
        while missing := sorted(_needed(found) & set(shipped) - set(found)):
            # Recorders leave out builtin_interfaces, and odd bags even std_msgs/Header.
            found |= {t: shipped[t] for t in missing}
        store.register(found)
        store.get_msgdef(name)
    except Exception as error:  # a parser of foreign text fails in many ways
        raise LogError(f"its definition cannot be read: {str(error).splitlines()[0]}") from error
    return store


@cache
def _shipped(encoding: str, *, later: bool = False) -> Typestore:
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if encoding == "ros1" else Stores.ROS2_HUMBLE)
    missing: Typesdict = {}
    for name, text in (DEFINITIONS | LATER_DEFINITIONS if later else DEFINITIONS).items():
        if name not in store.fielddefs:
            missing |= get_types_from_msg(text, name)
    store.register(missing)
    return store


def _needed(definitions: Typesdict) -> set[str]:
    """Names of the types that fields of these definitions have, and rosbags' two time types."""
    from rosbags.interfaces import Nodetype

    names = {"builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration"}
    for _, fields in definitions.values():
        for _, (kind, args) in fields:
            inner = args[0] if kind in {Nodetype.ARRAY, Nodetype.SEQUENCE} else (kind, args)
            if isinstance(inner, tuple) and inner[0] == Nodetype.NAME:
                names.add(str(inner[1]))
    return names
