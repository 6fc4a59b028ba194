"""check_decoder and check_payload: the assertions every decoder must meet.

from slamreplay.testing.decoders import check_decoder
check_decoder(MY_DECODER, {"header": {...}, "temperature": 21.5}, {"temperature_c": 21.5})
"""

from __future__ import annotations

import copy
from collections.abc import Collection, Iterator, Mapping
from itertools import accumulate, pairwise
from types import SimpleNamespace
from typing import Any

import numpy as np

from slamreplay.bundle.manifest import Loss, Source
from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.tables import Ragged, Table
from slamreplay.errors import SlamreplayError
from slamreplay.geometry.times import NO_STAMP
from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages
from slamreplay.ingest.readers.reader import Block, Connection
from slamreplay.ingest.reading import read_rows
from slamreplay.testing.conformance import ConformanceError, demand

_ADDED = ("t_ns", "t_sensor_ns", "t_log_ns", "topic")


def check_decoder(
    decoder: Decoder,
    message: Mapping[str, Any],
    row: Mapping[str, Any],
    *,
    t_sensor_ns: int = NO_STAMP,
    topic: str = "",
    after: Mapping[str, Any] | None = None,
) -> None:
    """Raise ConformanceError at the first part of the contract that the decoder breaks.

    Args:
        decoder: of one message type.
        message: the fields of one literal message by name; structs are mappings, arrays are
            lists, and tuples where the definition fixes their length.
        row: what the first row of it must hold, exactly, in some or all columns.
        t_sensor_ns: the stamp of that row.
        topic: name of the topic, where the decoder reads in it what the messages are about.
        after: for a decoder that tells of changes alone, a message before it that differs.
    """
    demand(isinstance(decoder, Decoder), "not a Decoder")
    demand(decoder.table in TABLES, f"there is no table '{decoder.table}'")
    where = f"decoder of '{decoder.table}'"
    demand(len(_table(decoder, [], topic)) == 0, f"{where} makes rows of no messages")

    before = [] if after is None else [_message(after)]
    literal = _message(message)
    untouched = repr(literal)
    table = _table(decoder, [*before, literal], topic)
    own = _decode(decoder, [*before, literal], topic).rows == len(before)
    table = table.take(own)
    demand(len(table) > 0, f"{where} makes no row of the message")
    for name, expected in row.items():
        got = table[name][0]
        equal = np.array_equal(_plain(got), _plain(expected), equal_nan=_is_numeric(got))
        demand(equal, f"{where}: '{name}' is {got!r}, expected {expected!r}")
    got_stamp = int(table["t_sensor_ns"][0])
    demand(got_stamp == t_sensor_ns, f"{where}: stamp is {got_stamp}, expected {t_sensor_ns}")
    demand(repr(literal) == untouched, f"{where} writes into the message")

    count = len(table)
    twice = _decode(decoder, [*before, literal, _message(message)], topic)
    again = twice.rows[np.isin(twice.rows, [len(before), len(before) + 1])].tolist()
    if after is None:
        demand(
            again == [0] * count + [1] * count,
            f"{where}: two equal messages do not give the same rows one after the other",
        )
    else:
        demand(again == [1] * count, f"{where}: a message that changes nothing makes a row")
    _survives_damage(decoder, message, count, before, topic)


def check_payload(type_name: str, payload: bytes, *, encoding: str = "cdr") -> None:
    """Raise ConformanceError unless a serialised message becomes rows, and a broken one is counted.

    Args:
        type_name: a registered message type, `package/msg/Type`.
        payload: one message as the container holds it.
        encoding: "cdr" or "ros1".
    """
    rows, losses = _read(type_name, [payload], encoding)
    demand(len(rows) == 1 and rows[0].messages == 1, f"{type_name} is not read: {losses}")
    rows, losses = _read(type_name, [payload, payload[: len(payload) // 2], b""], encoding)
    read = rows[0].messages if rows else 0
    lost = [loss for loss in losses if loss.kind == "lost" and "decoded" in loss.reason]
    demand(
        read == 1 and sum(loss.count for loss in lost) == 2 and "log time" in lost[0].reason,
        f"{type_name}: messages of the wrong length are not counted with topic and time",
    )
    _, losses = _read("nobody_msgs/msg/Unknown", [payload] * 3, encoding)
    skipped = [loss for loss in losses if loss.kind == "skipped"]
    demand(
        len(skipped) == 1 and skipped[0].count == 3 and "Unknown" in skipped[0].what,
        "messages of an unknown type are not counted",
    )


def _survives_damage(
    decoder: Decoder, message: Mapping[str, Any], count: int, before: list[Any], topic: str
) -> None:
    """Numbers that are none and arrays that are empty: recovered, counted, or one clear error."""
    for path, kind in _leaves(message):
        damaged = copy.deepcopy(message)
        _put(damaged, path, float("nan") if kind == "number" else [])
        name = ".".join(str(step) for step in path)
        try:
            decoded = _decode(decoder, [*before, _message(damaged)], topic)
            _table(decoder, [*before, _message(damaged)], topic)
        except SlamreplayError:
            continue
        except Exception as error:
            raise ConformanceError(
                f"decoder of '{decoder.table}' breaks down where {name} is damaged: {error!r}"
            ) from error
        told = sum(remark.count for remark in decoded.remarks)
        rows = int((decoded.rows == len(before)).sum())
        silent = kind == "number" and rows < count and not told
        demand(not silent, f"decoder of '{decoder.table}' drops rows in silence: {name} is nan")


def _decode(decoder: Decoder, items: list[Any], topic: str) -> Decoded:
    return decoder.decode(Messages(items, np.arange(len(items), dtype=np.int64), topic))


def _table(decoder: Decoder, items: list[Any], topic: str) -> Table:
    decoded = _decode(decoder, items, topic)
    n = len(decoded.rows)
    demand(len(decoded.t_sensor_ns) == n, f"decoder of '{decoder.table}': stamps are not one a row")
    names = {c.name for c in TABLES[decoder.table].columns} - set(_ADDED)
    odd = sorted(names ^ set(decoded.columns))
    demand(not odd, f"decoder of '{decoder.table}' lacks or invents columns: {', '.join(odd)}")
    zero = np.zeros(n, dtype=np.int64)
    times = {"t_ns": zero, "t_log_ns": zero, "t_sensor_ns": decoded.t_sensor_ns}
    return Table(TABLES[decoder.table], {**times, "topic": [""] * n, **decoded.columns})


def _message(value: Any) -> Any:
    if isinstance(value, Mapping):
        return SimpleNamespace(**{k: _message(v) for k, v in value.items()})
    if isinstance(value, list) and value and isinstance(value[0], Mapping):
        return [_message(v) for v in value]
    return np.array(value) if isinstance(value, list | tuple) else value


def _leaves(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[tuple[Any, ...], str]]:
    """Paths to every float and every list in a literal message."""
    if isinstance(value, Mapping):
        for key, inner in value.items():
            yield from _leaves(inner, (*path, key))
    elif isinstance(value, list):
        yield path, "list"
        if value and isinstance(value[0], Mapping):
            yield from _leaves(value[0], (*path, 0))
    elif isinstance(value, float):
        yield path, "number"


def _put(message: Any, path: tuple[Any, ...], value: Any) -> None:
    for step in path[:-1]:
        message = message[step]
    message[path[-1]] = value


def _plain(value: Any) -> Any:
    return np.asarray(value.values if isinstance(value, Ragged) else value)


def _is_numeric(value: Any) -> bool:
    return np.asarray(value).dtype.kind in "fiub"


class _Payloads:
    """A container in memory with one connection."""

    def __init__(self, type_name: str, payloads: list[bytes], encoding: str) -> None:
        self.connections = (Connection(0, "/topic", type_name, encoding, "", "msg", len(payloads)),)
        self.sources: tuple[Source, ...] = ()
        self.losses: list[Loss] = []
        self._payloads = payloads

    def blocks(self, wanted: Collection[int]) -> Iterator[Block]:
        if 0 in wanted:
            ends = [0, *accumulate(len(payload) for payload in self._payloads)]
            found = [(0, a, b, k) for k, (a, b) in enumerate(pairwise(ends))]
            yield Block.of(b"".join(self._payloads), found)


def _read(type_name: str, payloads: list[bytes], encoding: str) -> tuple[list[Any], list[Loss]]:
    return read_rows([_Payloads(type_name, payloads, encoding)], lambda _: None, None)
