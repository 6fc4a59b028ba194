"""From payload to message: rosbags' type stores, filled with the log's own definitions."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING, Any

from slamreplay.errors import LogError
from slamreplay.ingest.readers.reader import Connection
from slamreplay.messages.definitions import DEFINITIONS
from slamreplay.messages.interfaces import message_definition
from slamreplay.messages.layouts import likeliest_layout

if TYPE_CHECKING:
    from rosbags.interfaces.typing import Typesdict
    from rosbags.typesys.store import Typestore


def deserialiser(connection: Connection) -> Callable[[bytes], Any]:
    """The function that turns a connection's payloads into messages.

    The log's own definition wins; each definition has a store of its own, so that two layouts of
    one type in one log do not meet. Without one, ROS 2's types and `slamreplay.messages` are used.

    Raises:
        LogError: the encoding is unknown here, or the type has no (readable) definition.
    """
    if connection.encoding not in {"ros1", "cdr"}:
        raise LogError(f"messages are encoded as '{connection.encoding or 'unknown'}'")
    store = _store(connection.encoding, connection.type, connection.definition_format,
                   connection.definition)  # fmt: skip
    name = connection.type
    if connection.encoding == "ros1":
        return lambda data: store.deserialize_ros1(data, name)
    return lambda data: store.deserialize_cdr(data, name)


@cache
def _store(encoding: str, name: str, form: str, text: str) -> Typestore:
    from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

    text = message_definition(name, text) if text else likeliest_layout(name)
    if not text:
        store = _shipped(encoding)
        if name not in store.fielddefs:
            raise LogError("the log has no definition of this type, and neither do we")
        return store
    store = get_typestore(Stores.EMPTY)
    shipped = _shipped(encoding).fielddefs
    try:
        found = get_types_from_idl(text) if form == "idl" else get_types_from_msg(text, name)
        if "/srv/" in name:  # rosbags knows no names of this form
            found = {name: found.pop(next(iter(found))), **found}
        while missing := sorted(_needed(found) & set(shipped) - set(found)):
            # Recorders leave out builtin_interfaces, and odd bags even std_msgs/Header.
            found |= {t: shipped[t] for t in missing}
        store.register(found)
        store.get_msgdef(name)
    except Exception as error:  # a parser of foreign text fails in many ways
        raise LogError(f"its definition cannot be read: {str(error).splitlines()[0]}") from error
    return store


@cache
def _shipped(encoding: str) -> Typestore:
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if encoding == "ros1" else Stores.ROS2_HUMBLE)
    missing: Typesdict = {}
    for name, text in DEFINITIONS.items():
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
