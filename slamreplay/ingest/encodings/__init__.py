"""Messages of MCAP files that are not in ROS's own encodings: JSON and protobuf.

Both become objects with the fields of one definition, ours of the type (`slamreplay.messages` and
the ROS stores): the same names, numbers as numpy and Python have them, times as `sec` and
`nanosec`. So decoders cannot tell what a message was written in. What a log's own schema says of
JSON is not read; what it says of protobuf is needed, and checked against the definition first.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any, Protocol

from slamreplay.errors import LogError
from slamreplay.ingest.encodings.definition import definition
from slamreplay.ingest.readers.reader import Connection


class Deserialiser(Protocol):
    """Payload to message; ValueError where it is broken.

    `missing` counts, by path, the fields that a decoder asked for and a message did not have.
    """

    missing: Counter[str]

    def __call__(self, data: bytes) -> Any:
        """The message in a payload."""
        ...


def deserialiser(connection: Connection) -> Deserialiser:
    """The function that turns a connection's JSON or protobuf payloads into messages.

    Raises:
        LogError: the type is none we know, or its protobuf schema is broken or means another one.
    """
    make: dict[str, Callable[[], Deserialiser]] = {
        "json": lambda: _json(connection),
        "protobuf": lambda: _protobuf(connection),
    }
    if connection.encoding not in make:
        raise LogError(f"messages are encoded as '{connection.encoding or 'unknown'}'")
    return make[connection.encoding]()


def _json(connection: Connection) -> Deserialiser:
    from slamreplay.ingest.encodings.json_text import JsonMessages

    return JsonMessages(definition(connection.type))


def _protobuf(connection: Connection) -> Deserialiser:
    from slamreplay.ingest.encodings.protobuf import ProtobufMessages

    return ProtobufMessages(definition(connection.type), connection.type, connection.schema)
