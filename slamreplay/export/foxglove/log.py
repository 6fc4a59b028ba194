"""An mcap file of protobuf messages: same messages, same bytes."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType
from typing import Self

from google.protobuf.message import Message
from mcap.well_known import MessageEncoding
from mcap.writer import CompressionType, Writer
from mcap_protobuf.schema import register_schema

_LIBRARY = "slamreplay export"


class McapLog:
    """Writes messages in the order they are given; time never runs backwards in it.

    Args:
        path: the file.

    Attributes:
        schemas: topic to the name of its schema, for every topic that has a message.
    """

    def __init__(self, path: Path) -> None:
        self.schemas: dict[str, str] = {}
        self._channels: dict[str, int] = {}
        self._ids: dict[str, int] = {}
        self._counts: dict[str, int] = {}
        self._stream = path.open("wb")
        self._writer = Writer(self._stream, compression=CompressionType.ZSTD)
        self._writer.start(profile="", library=_LIBRARY)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if error is None:
            self._writer.finish()
        self._stream.close()

    def send(self, t_ns: int, topic: str, message: Message) -> None:
        """One message, told and recorded at one moment."""
        name = message.DESCRIPTOR.full_name
        if topic not in self._channels:
            if name not in self._ids:
                self._ids[name] = register_schema(self._writer, type(message))
            self._channels[topic] = self._writer.register_channel(
                topic, MessageEncoding.Protobuf, self._ids[name]
            )
            self.schemas[topic] = name
        assert self.schemas[topic] == name
        self._counts[topic] = self._counts.get(topic, 0) + 1
        self._writer.add_message(
            self._channels[topic],
            log_time=t_ns,
            publish_time=t_ns,
            sequence=self._counts[topic],
            data=message.SerializeToString(deterministic=True),
        )

    def facts(self, name: str, of: dict[str, str]) -> None:
        """A metadata record."""
        self._writer.add_metadata(name, of)

    def attach(self, t_ns: int, name: str, media_type: str, data: bytes) -> None:
        """A file inside the file."""
        self._writer.add_attachment(t_ns, t_ns, name, media_type, data)
