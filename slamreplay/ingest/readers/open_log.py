"""Which container a path is, judged by its first bytes, and several files as one log."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from slamreplay.bundle.manifest import Loss, Source
from slamreplay.errors import LogError
from slamreplay.ingest.readers import mcap_file, ros1, sqlite_file
from slamreplay.ingest.readers.compression import ZSTD
from slamreplay.ingest.readers.reader import Block, Reader
from slamreplay.ingest.wire.places import gather

_KINDS: list[tuple[bytes, str, Callable[[Path, Source], Reader]]] = [
    (ros1.MAGIC, "ros1", ros1.Ros1Reader),
    (mcap_file.MAGIC, "mcap", mcap_file.McapReader),
    (sqlite_file.MAGIC, "sqlite3", sqlite_file.SqliteReader),
]
_SUFFIXES = {".bag", ".mcap", ".db3", ".zstd"}


@contextmanager
def open_log(paths: Sequence[Path]) -> Iterator[tuple[list[Reader], list[Loss]]]:
    """Readers of all files behind the paths, and losses on the way (a file given twice).

    Raises:
        LogError: a path does not exist, or is no log.
    """
    losses: list[Loss] = []
    with ExitStack() as stack:
        readers: list[Reader] = []
        seen: set[str] = set()
        for path in paths:
            for file in _files(path, losses):
                digest = _hash(file)
                if digest in seen:
                    losses.append(
                        Loss(kind="skipped", what=file.name, count=1, reason="the same file twice")
                    )
                    continue
                seen.add(digest)
                readers.append(_open(file, digest, stack))
        if not readers:
            raise LogError("no storage file in it", where=paths[0] if paths else None)
        yield readers, losses


def _files(path: Path, losses: list[Loss]) -> list[Path]:
    """Storage files of a path."""
    if path.is_file():
        return [path]
    if not path.exists():
        raise LogError("no such file or folder", where=path)
    if not path.is_dir():
        raise LogError("neither a file nor a folder", where=path)
    meta = _metadata(path / "metadata.yaml")
    told = meta.get("relative_file_paths")
    listed = [str(name) for name in told] if isinstance(told, list) else []
    files = []
    for name in listed:
        places = [path / name, path / Path(name).name, path / f"{name}.zstd"]
        found = next((p for p in places if _is_file(p)), None)
        if found is None:
            losses.append(
                Loss(kind="lost", what=name, count=1, reason="metadata.yaml names it, not there")
            )
        else:
            files.append(found)
    if not files:  # without a usable metadata.yaml the folder itself says what belongs to it
        files = sorted(p for p in path.iterdir() if p.suffix in _SUFFIXES and p.is_file())
        if files:
            losses.append(
                Loss(
                    kind="repaired",
                    what="metadata.yaml",
                    count=1,
                    reason="missing or empty; read the storage files themselves",
                )
            )
    if not files:
        raise LogError(
            "a folder without a storage file",
            where=path,
            hint="give a .bag, .mcap or .db3, or a folder of rosbag2 or MRCLAM",
        )
    return files


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except OSError:  # a name that no file can have
        return False


def _metadata(path: Path) -> dict[str, Any]:
    try:
        whole = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError, yaml.YAMLError):  # ValueError: a month of 13
        return {}
    meta = whole.get("rosbag2_bagfile_information") if isinstance(whole, dict) else None
    return meta if isinstance(meta, dict) else {}


def _open(path: Path, digest: str, stack: ExitStack) -> Reader:
    file = path
    head = _head(path)
    if head.startswith(ZSTD):
        file = _decompressed(path, stack)
        head = _head(file)
    for magic, name, reader in _KINDS:
        if head.startswith(magic):
            size = path.stat().st_size
            source = Source(name=path.name, format=name, bytes=size, sha256=digest)
            opened = reader(file, source)
            return opened if name == "ros1" else _Decompressing(opened)
    what = "the file is empty" if not head else "not a log that is known here"
    raise LogError(what, where=path, hint="a .bag, .mcap, .db3 or CARMEN .clf is expected")


class _Decompressing:
    """A reader of a rosbag2 file whose messages may be compressed one by one with zstd.

    Each message tells by its first bytes: metadata.yaml, which says so too, may be gone, and no
    message that is not compressed begins like that (CDR begins with a zero).
    """

    def __init__(self, inner: Reader) -> None:
        self._inner = inner
        self._broken = 0
        self.sources, self.connections = inner.sources, inner.connections

    @property
    def losses(self) -> list[Loss]:
        """See `Reader`."""
        if not self._broken:
            return self._inner.losses
        what, why = f"{self.sources[0].name}: messages", "their zstd compression is damaged"
        own = Loss(kind="lost", what=what, count=self._broken, reason=why)
        return [*self._inner.losses, own]

    def blocks(self, wanted: Collection[int]) -> Iterator[Block]:
        """See `Reader`."""
        self._broken = 0
        of_ros2 = np.array([c.encoding == "cdr" for c in self.connections], dtype=bool)
        for block in self._inner.blocks(wanted):
            place = np.flatnonzero((block.end - block.start >= 4) & of_ros2[block.connection])
            heads = gather(block.data, block.start[place], 0, 4)
            is_packed = np.zeros(len(block), dtype=bool)
            is_packed[place] = (heads == np.frombuffer(ZSTD, dtype=np.uint8)).all(axis=1)
            yield self._unpacked(block, is_packed) if is_packed.any() else block

    def _unpacked(self, block: Block, is_packed: NDArray[np.bool_]) -> Block:
        import zstandard

        whole, payloads = [], []
        view = memoryview(block.data.data)
        bounds = zip(block.start.tolist(), block.end.tolist(), is_packed.tolist(), strict=True)
        for k, (a, b, packed) in enumerate(bounds):
            try:
                stream = zstandard.ZstdDecompressor().decompressobj()
                payloads.append(stream.decompress(view[a:b]) if packed else bytes(view[a:b]))
                whole.append(k)
            except zstandard.ZstdError:
                self._broken += 1
        end = np.cumsum([len(p) for p in payloads], dtype=np.int64)
        data = np.frombuffer(b"".join(payloads), dtype=np.uint8)
        start = np.concatenate([[0], end[:-1]]).astype(np.int64)
        return Block(data, block.connection[whole], start, end, block.t_log_ns[whole])


def _head(path: Path) -> bytes:
    try:
        with path.open("rb") as stream:
            return stream.read(64)
    except OSError as error:
        raise LogError(f"cannot read: {error.strerror or error}", where=path) from error


def _hash(path: Path) -> str:
    try:
        with path.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError as error:
        raise LogError(f"cannot read: {error.strerror or error}", where=path) from error


def _decompressed(path: Path, stack: ExitStack) -> Path:
    import zstandard

    folder = stack.enter_context(TemporaryDirectory(prefix="slamreplay-"))
    out = Path(folder) / path.stem
    try:
        with path.open("rb") as source, out.open("wb") as target:
            zstandard.ZstdDecompressor().copy_stream(source, target)
    except (zstandard.ZstdError, OSError) as error:
        raise LogError(f"its zstd compression is damaged: {error}", where=path) from error
    return out
