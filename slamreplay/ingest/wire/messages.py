"""The messages of one topic as columns, read from the buffer they were recorded in."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.tables import Ragged
from slamreplay.geometry.times import Times
from slamreplay.geometry.transforms import clean_frame
from slamreplay.ingest.decoders.decoder import FieldError, Messages
from slamreplay.ingest.wire.places import (
    Bytes,
    GroupPlace,
    ManyPlace,
    NumberPlace,
    Place,
    RunPlace,
    TextPlace,
    as_numbers,
    gather,
    numbers,
)

_Kind = TypeVar("_Kind", NumberPlace, RunPlace, TextPlace, ManyPlace)


class WireMessages(Messages):
    """Messages that are bytes in a buffer; a field is read when a decoder asks for it.

    Fields are found by their names as in `Messages`; one that the type does not have, or that is
    of another kind than it is read as, raises FieldError.

    Args:
        data: the buffer.
        place: where the fields are.
        t_log_ns: (N,) when each was recorded.
        topic: its name.
    """

    def __init__(self, data: Bytes, place: Place, t_log_ns: Times, topic: str = "") -> None:
        super().__init__((), t_log_ns, topic)
        self._data = data
        self._place = place
        self._codes: dict[str, tuple[list[str], NDArray[np.int64]]] = {}

    def __len__(self) -> int:
        return len(self.t_log_ns)

    def has(self, path: str) -> bool:
        """See `Messages`."""
        try:
            self._at(path)
        except FieldError:
            return False
        return len(self) > 0

    def column(self, path: str, dtype: Any = np.float64) -> NDArray[Any]:
        """See `Messages`."""
        return _cast(numbers(self._data, self._found(path, NumberPlace)), dtype)

    def columns(self, path: str, names: str) -> NDArray[np.float64]:
        """See `Messages`."""
        out = np.empty((len(self), len(names)))
        places = [self._found(f"{path}.{name}" if path else name, NumberPlace) for name in names]
        first = places[0]
        size = int(first.dtype[2])
        # Fields side by side, as vectors are, are read in one go.
        if all(
            p.base is first.base and p.dtype == first.dtype and p.offset == first.offset + k * size
            for k, p in enumerate(places)
        ):
            out[:] = gather(self._data, first.base, first.offset, size * len(names)).view(
                first.dtype
            )
        else:
            for k, place in enumerate(places):
                out[:, k] = numbers(self._data, place)
        return out

    def fixed(self, path: str, size: int) -> NDArray[np.float64]:
        """See `Messages`."""
        place = self._found(path, RunPlace)
        if len(self) and np.any(np.asarray(place.counts) != size):
            raise FieldError(f"{path} does not hold {size} numbers")
        return numbers(self._data, place, size).astype(np.float64)

    def ragged(self, path: str, dtype: Any) -> Ragged:
        """See `Messages`; with the dtype object texts too."""
        if isinstance(self._at(path), ManyPlace):
            return self._ragged_texts(path)
        place = self._found(path, RunPlace)
        n = len(self)
        if isinstance(place.counts, int):
            values = numbers(self._data, place, place.counts).ravel()
            offsets = place.counts * np.arange(n + 1, dtype=np.int64)
            return Ragged(_cast(values, dtype), offsets)
        counts = place.counts
        size = int(place.dtype[2])
        begin = place.base + place.offset
        view = memoryview(self._data.data)
        pieces = [
            view[a:b] for a, b in zip(begin.tolist(), (begin + counts * size).tolist(), strict=True)
        ]
        values = as_numbers(np.frombuffer(b"".join(pieces), dtype=np.uint8), place.dtype)
        offsets = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
        return Ragged(_cast(values, dtype), offsets)

    def texts(self, path: str) -> NDArray[Any]:
        """See `Messages`."""
        return self._texts(path, str)

    def frames(self, path: str = "header.frame_id") -> NDArray[Any]:
        """See `Messages`."""
        return self._texts(path, clean_frame)

    def children(self, path: str) -> tuple[Messages, NDArray[np.int64]]:
        """See `Messages`."""
        place = self._found(path, ManyPlace)
        rows = np.repeat(np.arange(len(self), dtype=np.int64), place.counts)
        return WireMessages(self._data, place.element, self.t_log_ns[rows], self.topic), rows

    def take(self, mask: NDArray[np.bool_]) -> Messages:
        """See `Messages`."""
        index = np.flatnonzero(mask)
        return WireMessages(self._data, self._place.take(index), self.t_log_ns[index], self.topic)

    def _at(self, path: str) -> Place:
        place = self._place
        for name in path.split(".") if path else ():
            if not isinstance(place, GroupPlace) or name not in place.fields:
                raise FieldError(f"there is no field {path}")
            place = place.fields[name]
        return place

    def _found(self, path: str, kind: type[_Kind]) -> _Kind:
        place = self._at(path)
        if not isinstance(place, kind):
            raise FieldError(f"{path or 'an element'} is of another kind")
        return place

    def _ragged_texts(self, path: str) -> Ragged:
        place = self._found(path, ManyPlace)
        texts, _ = self.children(path)
        offsets = np.concatenate([[0], np.cumsum(place.counts)]).astype(np.int64)
        return Ragged(texts.texts(""), offsets)

    def _texts(self, path: str, change: Callable[[str], str]) -> NDArray[Any]:
        """Texts, each distinct one decoded and changed once."""
        words, codes = self._coded(path)
        changed = np.array([*map(change, words), ""], dtype=object)[:-1]
        return changed[codes]

    def _coded(self, path: str) -> tuple[list[str], NDArray[np.int64]]:
        """Distinct texts, and for each message which of them it has; found once for each field."""
        if path in self._codes:
            return self._codes[path]
        place = self._found(path, TextPlace)
        if isinstance(place.lengths, int):
            groups = [(place.lengths, np.arange(len(self)))]
        else:
            lengths = place.lengths
            groups = [(int(n), np.flatnonzero(lengths == n)) for n in np.unique(lengths)]
        words: list[str] = []
        codes = np.empty(len(self), dtype=np.int64)
        for length, index in groups:
            raw = gather(self._data, place.base[index], place.offset, length)
            distinct, own = _distinct(raw)
            codes[index] = own + len(words)
            words += [bytes(word).decode("utf-8", "replace") for word in distinct]
        self._codes[path] = words, codes
        return words, codes


def _cast(values: NDArray[Any], dtype: Any) -> NDArray[Any]:
    """Numbers as another dtype; Python's own numbers for object."""
    if dtype is object:
        return np.array([*values.tolist(), None], dtype=object)[:-1]
    return np.ascontiguousarray(values, dtype=dtype)


def _distinct(raw: Bytes) -> tuple[Bytes, NDArray[np.int64]]:
    """Distinct rows (K, L) of bytes (N, L), and for each row which of them it is."""
    n, length = raw.shape
    if n == 0 or length == 0 or bool((raw == raw[0]).all()):
        return raw[:1], np.zeros(n, dtype=np.int64)
    keys = np.ascontiguousarray(raw).view(f"V{length}")[:, 0]
    index: dict[bytes, int] = {}
    codes = np.array([index.setdefault(key, len(index)) for key in keys.tolist()], dtype=np.int64)
    first = np.frombuffer(b"".join(index), dtype=np.uint8).reshape(-1, length)
    return first, codes
