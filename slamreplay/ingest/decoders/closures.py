"""rtabmap's Info: closures of its graph, each in the message in which it was made."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slamreplay.geometry.times import Times
from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages, Remark

#: rtabmap's fields: the node in hand, then each kind of closure; in ROS 2, ROS 1, and long ago.
_NODE = ("ref_id", "refId")
_KINDS = {
    "loop_closure": ("loop_closure_id", "loopClosureId"),
    "proximity": ("proximity_detection_id", "proximityDetectionId", "localLoopClosureId"),
    "landmark": ("landmark_id", "landmarkId"),
}
_STATS = (("stats_keys", "stats_values"), ("statsKeys", "statsValues"))


def _info(messages: Messages) -> Decoded:
    node = _field(messages, _NODE)
    parts: dict[str, list[Any]] = {"rows": [], "kind": [], "to": [], "score": []}
    for kind, names in _KINDS.items():
        to = _field(messages, names)
        rows = np.flatnonzero(to)
        score = _scores(messages, to) if kind == "loop_closure" else np.full(len(to), np.nan)
        parts["rows"].append(rows)
        parts["kind"].append(np.full(len(rows), kind, dtype=object))
        parts["to"].append(to[rows])
        parts["score"].append(score[rows])
    whole = {name: np.concatenate(arrays) for name, arrays in parts.items()}
    order = np.argsort(whole["rows"], kind="stable")
    rows = whole["rows"][order].astype(np.int64)
    nowhere = np.full((len(rows), 2, 3), np.nan)
    ids = np.column_stack([node[rows], whole["to"][order]])
    number = np.zeros(len(rows), dtype=np.int32)
    frames, stamps = messages.frames()[rows], messages.stamps()[rows]
    return closure_rows(frames, stamps, rows, whole["kind"][order], id_texts(ids), number, nowhere,
                     score=whole["score"][order])  # fmt: skip


def _field(messages: Messages, names: Sequence[str]) -> NDArray[np.int64]:
    """(N,) the first of the fields that the messages have, zeros where they have none."""
    for name in names:
        if messages.has(name):
            return messages.column(name, np.int64)
    return np.zeros(len(messages), dtype=np.int64)


def _scores(messages: Messages, accepted: NDArray[np.int64]) -> NDArray[np.float64]:
    """(N,) the value of rtabmap's highest hypothesis where that is the one it accepted."""
    score = np.full(len(messages), np.nan)
    for keys, values in _STATS:
        if messages.has(keys):
            names, numbers = messages.ragged(keys, object), messages.ragged(values, np.float64)
            for row in np.flatnonzero(accepted):
                told = dict(zip(names[int(row)], numbers[int(row)], strict=False))
                if told.get("Loop/Highest_hypothesis_id/") == accepted[row]:
                    score[row] = told.get("Loop/Highest_hypothesis_value/", np.nan)
    return score


def id_texts(ids: NDArray[np.int64]) -> NDArray[np.object_]:
    """Ids (M, 2) as the table holds them."""
    return ids.astype(str).astype(object).reshape(-1, 2)


def closure_rows(
    frames: NDArray[np.object_],
    t_sensor_ns: Times,
    rows: NDArray[np.int64],
    kind: NDArray[np.object_],
    ids: NDArray[np.object_],
    number: NDArray[np.int32],
    ends: NDArray[np.float64],
    *,
    score: NDArray[np.float64] | None = None,
    remarks: tuple[Remark, ...] = (),
) -> Decoded:
    """Rows of table closures.

    Args:
        frames: (M,) frame of the ends.
        t_sensor_ns: (M,) when.
        rows: (M,) the message each came from.
        kind: (M,) see the table.
        ids: (M, 2) of the ends, empty where they are not told.
        number: (M,) place in the list of its kind.
        ends: (M, 2, 3) where the ends are, m; NaN where it is not told.
        score: (M,) None where there is none.
        remarks: what was left out.
    """
    columns = {
        "frame_id": frames,
        "kind": kind,
        "from_id": ids[:, 0],
        "to_id": ids[:, 1],
        "number": number,
        "from_xyz": ends[:, 0],
        "to_xyz": ends[:, 1],
        "score": np.full(len(rows), np.nan) if score is None else score,
    }
    return Decoded(columns, rows, t_sensor_ns, remarks)


RTABMAP_INFO = Decoder("closures", _info)
