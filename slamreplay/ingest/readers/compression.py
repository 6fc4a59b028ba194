"""Compressed chunks: whole ones fast, cut ones as far as they go."""

from __future__ import annotations

import bz2
from functools import cache
from typing import Any

#: A chunk that claims to be larger than this is damaged: recorders close theirs after megabytes.
MAX_CHUNK_BYTES = 2_000_000_000
#: First bytes of a frame of zstd (RFC 8878, section 3.1.1).
ZSTD = b"\x28\xb5\x2f\xfd"
_PIECE = 65536
#: Slices of a memoryview are not copied.
Bytes = bytes | memoryview


def decompress(data: Bytes, codec: str, size: int) -> Bytes:
    """The content of a chunk.

    Args:
        data: as recorded.
        codec: "", "none", "zstd", "lz4" or "bz2".
        size: bytes of the content, as the container says.

    Raises:
        ValueError: it is damaged, or the codec is not known.
    """
    if not 0 <= size <= MAX_CHUNK_BYTES:
        raise ValueError(f"it claims to hold {size} bytes")
    try:
        content: Bytes
        if codec in ("", "none"):
            content = data
        elif codec == "bz2":
            content = bz2.decompress(data)
        elif codec in ("zstd", "lz4"):
            content = memoryview(_arrow(codec).decompress(data, decompressed_size=size))
        else:
            raise ValueError(f"unknown compression '{codec}'")
    except (OSError, EOFError) as error:  # pyarrow's errors are OSErrors
        raise ValueError(f"damaged {codec} data") from error
    if len(content) != size:
        raise ValueError(f"{len(content)} bytes instead of {size}")
    return content


def decompress_start(data: Bytes, codec: str) -> Bytes:
    """As much of a cut chunk's content as its first bytes give; nothing of an unknown codec."""
    if codec in ("", "none"):
        return data
    stream: Any
    if codec == "bz2":
        stream = bz2.BZ2Decompressor()
    elif codec == "zstd":
        import zstandard

        stream = zstandard.ZstdDecompressor().decompressobj()
    elif codec == "lz4":
        import lz4.frame  # type: ignore[import-untyped]

        stream = lz4.frame.LZ4FrameDecompressor()
    else:
        return b""
    found = bytearray()
    try:
        for at in range(0, len(data), _PIECE):
            found += stream.decompress(data[at : at + _PIECE])
    except (OSError, EOFError, ValueError, RuntimeError, _zstd_error()):
        pass  # what came before the damage is good
    return bytes(found)


@cache
def _arrow(codec: str) -> Any:
    import pyarrow as pa  # its codecs are the fastest at hand: half the time of the others

    return pa.Codec(codec)


@cache
def _zstd_error() -> type[Exception]:
    import zstandard

    return zstandard.ZstdError
