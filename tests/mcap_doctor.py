"""The rules of `mcap doctor --strict-message-order`, as assertions.

Source: foxglove/mcap, go/cli/mcap/cmd/doctor.go. Other languages' readers rest on them.
"""

import io
from collections import Counter
from pathlib import Path

from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    Message,
    MessageIndex,
    Schema,
    Statistics,
)
from mcap.stream_reader import StreamReader, breakup_chunk


class Doctor:
    """Examines one file; whatever is wrong fails an assertion."""

    def __init__(self, path: Path) -> None:
        self.data = path.read_bytes()
        self.schemas: set[int] = set()
        self.topics: dict[int, str] = {}
        self.counts: Counter[int] = Counter()
        self.latest_ns = 0
        self.in_chunk: Counter[int] = Counter()
        self.indexed: Counter[int] = Counter()

    def examine(self) -> None:
        seen = Counter()
        record = None
        stream = io.BytesIO(self.data)
        for record in StreamReader(stream, emit_chunks=True, validate_crcs=True).records:
            seen[type(record)] += 1
            if not isinstance(record, MessageIndex):
                assert self.indexed == self.in_chunk  # every message has its entry in an index
            match record:
                case Header(library=library, profile=profile):
                    assert library
                    assert profile in ("", "ros1", "ros2")
                case Chunk():
                    self.examine_chunk(record)
                case MessageIndex():
                    assert record.channel_id not in self.indexed
                    if record.records:
                        self.indexed[record.channel_id] = len(record.records)
                case ChunkIndex():
                    self.examine_chunk_index(record)
                case Statistics():
                    self.examine_statistics(record, seen)
                case Message():
                    raise AssertionError("a message outside of chunks")
        assert isinstance(record, Footer)
        assert seen[DataEnd] == seen[Statistics] == 1
        assert seen[ChunkIndex] == seen[Chunk] > 0

    def examine_chunk(self, chunk: Chunk) -> None:
        assert chunk.compression in ("", "lz4", "zstd")
        times = []
        self.in_chunk, self.indexed = Counter(), Counter()
        for record in breakup_chunk(chunk, validate_crc=True):
            match record:
                case Schema():
                    assert record.id > 0
                    assert record.id not in self.schemas
                    assert record.encoding
                    self.schemas.add(record.id)
                case Channel():
                    assert record.id not in self.topics
                    assert record.schema_id in self.schemas
                    self.topics[record.id] = record.topic
                case Message():
                    assert record.channel_id in self.topics
                    assert record.log_time >= self.latest_ns
                    self.latest_ns = record.log_time
                    times.append(record.log_time)
                    self.in_chunk[record.channel_id] += 1
        self.counts += self.in_chunk
        assert (chunk.message_start_time, chunk.message_end_time) == (times[0], times[-1])

    def examine_chunk_index(self, index: ChunkIndex) -> None:
        start = index.chunk_start_offset
        assert self.data[start] == Opcode.CHUNK
        length = int.from_bytes(self.data[start + 1 : start + 9], "little")
        assert index.chunk_length == 9 + length  # with opcode and length

    def examine_statistics(self, told: Statistics, seen: Counter) -> None:
        assert told.message_count == self.counts.total()
        assert told.channel_message_counts == self.counts
        assert (told.schema_count, told.channel_count) == (len(self.schemas), len(self.topics))
        assert told.chunk_count == seen[Chunk]
        assert told.message_end_time == self.latest_ns
