"""Lines of a text file, plain or compressed with gzip or bzip2; of a damaged one what is whole."""

from __future__ import annotations

import bz2
import hashlib
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, Protocol

from slamreplay.bundle.manifest import Loss, Source
from slamreplay.errors import LogError

GZIP, BZIP2 = b"\x1f\x8b", b"BZh"
#: A decoder that finds damage keeps back what the same call had decoded, so calls are small.
_STEP = 4096


class _Decoder(Protocol):
    @property
    def eof(self) -> bool: ...

    @property
    def unused_data(self) -> bytes: ...

    def decompress(self, data: bytes, /) -> bytes: ...


@dataclass(frozen=True)
class Text:
    """A file's lines, without their ends.

    Attributes:
        lines: all of them, the last one even where it was cut.
        source: the file as the manifest names it.
        losses: what could not be decompressed.
    """

    lines: list[bytes]
    source: Source
    losses: list[Loss]


def head_of(path: Path, size: int = 65_536) -> bytes:
    """The first bytes of a file's text, b"" where it cannot be read or decompressed."""
    parts: list[bytes] = []
    try:
        with path.open("rb") as stream:
            for part in decompressed(stream):
                parts.append(part)
                if sum(map(len, parts)) >= size:
                    break
    except (OSError, EOFError, zlib.error):
        pass
    return b"".join(parts)[:size]


def read_text(path: Path, form: str) -> Text:
    """All lines of a file.

    Args:
        path: plain text, or text in gzip or bzip2 (by its first bytes, whatever its name).
        form: format of the log, for the manifest.

    Raises:
        LogError: the file cannot be read, or nothing of it can be decompressed.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise LogError(f"cannot read: {error.strerror or error}", where=path) from error
    digest = hashlib.sha256(content).hexdigest()
    source = Source(name=path.name, format=form, bytes=len(content), sha256=digest)
    parts: list[bytes] = []
    losses = []
    try:
        parts.extend(decompressed(BytesIO(content)))
    except (OSError, EOFError, zlib.error) as error:
        good = sum(map(len, parts))
        if not good:
            raise LogError(f"its compression is damaged: {error}", where=path) from error
        reason = f"cut or broken after {good} bytes of text: {error}"
        losses.append(Loss(kind="lost", what=f"{path.name}: its end", count=1, reason=reason))
    return Text(b"".join(parts).replace(b"\r", b"").split(b"\n"), source, losses)


def decompressed(stream: BinaryIO) -> Iterator[bytes]:
    """The text of a stream in pieces, decompressed where its first bytes say that it is packed.

    Raises:
        OSError, EOFError, zlib.error: from here on it is damaged, or it ends too early.
    """
    data = stream.read(_STEP)
    decoder = _decoder_of(data)
    while decoder is None and data:
        yield data
        data = stream.read(_STEP)
    while decoder is not None:
        if not data:
            raise EOFError("the file ends in the middle of its compressed data")
        yield decoder.decompress(data)
        if not decoder.eof:
            data = stream.read(_STEP)
            continue
        data = decoder.unused_data + stream.read(_STEP)
        decoder = _decoder_of(data)  # another member may follow, as in files that were joined
        if decoder is None and data.strip(b"\0"):
            raise OSError("what follows is not compressed")


def _decoder_of(data: bytes) -> _Decoder | None:
    if data.startswith(GZIP):
        return zlib.decompressobj(wbits=31)
    return bz2.BZ2Decompressor() if data.startswith(BZIP2) else None
