"""rcl_interfaces/ParameterEvent and dynamic_reconfigure/Config: parameters that were set.

The parameter's name goes into the row's name, not into its message: a parameter called after a
bumper is no word of the bumper.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slamreplay.geometry.times import NO_STAMP, Times
from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages
from slamreplay.ingest.decoders.health import INFO

_SHOWN = 8  # of a list; the rest is dots
#: rcl_interfaces/ParameterType to the field of a ParameterValue that holds it.
_SCALARS = {1: "bool_value", 2: "integer_value", 3: "double_value", 4: "string_value"}
_ARRAYS = {5: "byte_array_value", 6: "bool_array_value", 7: "integer_array_value",
           8: "double_array_value", 9: "string_array_value"}  # fmt: skip


def _events(messages: Messages) -> Decoded:
    nodes = messages.texts("node")
    parts = []
    for field, verb in (("new", "declared as "), ("changed", "set to "), ("deleted", "deleted")):
        changes, rows = messages.children(f"{field}_parameters")
        values = _values(changes) if field != "deleted" else [""] * len(changes)
        names = [f"{nodes[row]}: {name}" for row, name in zip(rows, changes.texts("name"),
                                                              strict=True)]  # fmt: skip
        parts.append((rows, names, [verb + value for value in values]))
    return _rows(parts, messages.stamps("stamp"))


def _config(messages: Messages) -> Decoded:
    node = messages.topic.rpartition("/")[0]  # of /amcl/parameter_updates
    parts = []
    for field in ("bools", "ints", "strs", "doubles"):
        changes, rows = messages.children(field)
        names = [f"{node}: {name}" for name in changes.texts("name")]
        parts.append(
            (rows, names, [f"set to {text}" for text in _scalars(changes, "value", field)])
        )
    return _rows(parts, np.full(len(messages), NO_STAMP))


def _values(parameters: Messages) -> list[str]:
    kinds = parameters.column("value.type", np.int64)
    texts = np.full(len(parameters), "nothing", dtype=object)
    for kind, field in (*_SCALARS.items(), *_ARRAYS.items()):
        here = kinds == kind
        if not here.any():
            continue
        some, path = parameters.take(here), f"value.{field}"
        found: Sequence[Any]
        if kind in _SCALARS:
            found = _scalars(some, path, field)
        else:
            lists = some.ragged(path, object)
            found = [_list([_text(v) for v in lists[i]]) for i in range(len(some))]
        texts[here] = found
    return list(texts)


def _scalars(messages: Messages, path: str, kind: str) -> list[str]:
    is_text = kind.startswith("str")
    values = messages.texts(path) if is_text else messages.column(path, object)
    return [_text(value) for value in values]


def _text(value: Any) -> str:
    if isinstance(value, bool | np.bool_):
        return str(bool(value)).lower()
    return f"{value:.9g}" if isinstance(value, float) else str(value)


def _list(values: list[str]) -> str:
    dots = ["..."] if len(values) > _SHOWN else []
    return f"[{', '.join([*values[:_SHOWN], *dots])}]"


def _rows(
    parts: Sequence[tuple[NDArray[np.int64], list[str], list[str]]],
    t_sensor_ns: Times,
) -> Decoded:
    rows = np.concatenate([part[0] for part in parts])
    order = np.argsort(rows, kind="stable")
    rows = rows[order]
    columns = {
        "level": np.full(len(rows), INFO, dtype=np.int32),
        "name": _texts([name for part in parts for name in part[1]])[order],
        "message": _texts([message for part in parts for message in part[2]])[order],
    }
    return Decoded(columns, rows, t_sensor_ns[rows])


def _texts(values: list[str]) -> NDArray[np.object_]:
    out = np.empty(len(values), dtype=object)
    out[:] = values
    return out


PARAMETER_EVENT = Decoder("health", _events)
RECONFIGURE = Decoder("health", _config)
