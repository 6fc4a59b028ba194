"""SLAM graphs as visualization_msgs/MarkerArray: Cartographer's constraints, slam_toolbox's links.

A message lists the whole graph again; of every closure the first row is kept
(`slamreplay.ingest.repeats`). Ids that a message does not tell are empty.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slamreplay.ingest.decoders.closures import closure_rows, id_texts
from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages, Remark

#: Name spaces of Cartographer's markers (map_builder_bridge.cc): constraints between a submap and
#: a node that does not belong to it.
_CONSTRAINTS = {
    "Inter constraints, same trajectory": "inter_submap",
    "Inter constraints, different trajectories": "inter_trajectory",
}
#: visualization_msgs/Marker: types and action.
_SPHERE, _LINE_STRIP, _LINE_LIST, _ADD = 2, 4, 5, 0


def _graph(messages: Messages) -> Decoded:
    """Cartographer's constraint list or slam_toolbox's graph, by what is in it."""
    markers, rows = messages.children("markers")
    spaces = markers.texts("ns").astype(str)
    kinds = np.array([_CONSTRAINTS.get(space, "") for space in spaces], dtype=object)
    is_toolbox = np.char.startswith(spaces, "slam_toolbox")
    shape = markers.column("type", np.int64)
    added = markers.column("action", np.int64) == _ADD
    nodes = is_toolbox & added & (shape == _SPHERE)
    edges = is_toolbox & added & np.isin(shape, (_LINE_STRIP, _LINE_LIST))
    kinds[edges] = "link"
    pairs, owner, number = _pairs(markers, kinds != "")
    ids = _ends(markers, rows, np.flatnonzero(nodes), pairs, owner)
    apart = np.abs(ids[:, 0] - ids[:, 1])
    named, link = (ids >= 0).all(axis=1), kinds[owner] == "link"
    next_to, unnamed = link & named & (apart <= 1), link & ~named
    keep = np.flatnonzero(~next_to & ~unnamed)
    owner, from_row = owner[keep], rows[owner[keep]]
    with_edges = np.bincount(rows[edges], minlength=len(messages)) > 0
    with_nodes = np.bincount(rows[nodes], minlength=len(messages)) > 0
    used = nodes | (kinds != "") | ~added
    remarks = (
        Remark("skipped", int(next_to.sum()), "links of a scan to the one before it"),
        Remark("skipped", int(unnamed.sum()), "links whose ends no marker names"),
        Remark("skipped", int((with_nodes & ~with_edges).sum()), "graphs without their links"),
        Remark("skipped", int((~used).sum()), "markers of a graph that are no closure"),
    )
    names = id_texts(np.where(ids[keep] < 0, 0, ids[keep]))
    names[ids[keep] < 0] = ""
    # Stamps are the markers' own; rows stay in the order of messages, for markers are in theirs.
    return closure_rows(markers.frames()[owner], markers.stamps()[owner], from_row, kinds[owner],
                     names, number[keep], pairs[keep], remarks=remarks)  # fmt: skip


def _pairs(
    markers: Messages, wanted: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int32]]:
    """Lines (P, 2, 3) of the wanted markers, each one's marker (P,), and its number there (P,)."""
    points, owner = markers.children("points")
    place = np.arange(len(owner)) - np.searchsorted(owner, owner)
    count = np.bincount(owner, minlength=len(markers))
    even = wanted[owner] & (place < count[owner] // 2 * 2)
    xyz = points.columns("", "xyz")[even].reshape(-1, 2, 3)
    return xyz, owner[even][::2], (place[even][::2] // 2).astype(np.int32)


def _ends(
    markers: Messages,
    rows: NDArray[np.int64],
    nodes: NDArray[np.int64],
    pairs: NDArray[np.float64],
    owner: NDArray[np.int64],
) -> NDArray[np.int64]:
    """Ids (P, 2) of the nodes that lines begin and end at, -1 where no node is exactly there."""
    xy = markers.columns("pose.position", "xyz")[nodes, :2]
    place = np.column_stack([rows[nodes], xy])
    message = np.repeat(rows[owner], 2)
    ends = np.column_stack([message, pairs[..., :2].reshape(-1, 2)])
    which = _groups(np.vstack([place, ends]))
    id_of = np.full(len(which), -1, dtype=np.int64)
    id_of[which[: len(nodes)]] = markers.column("id", np.int64)[nodes]
    return id_of[which[len(nodes) :]].reshape(-1, 2)


def _groups(values: NDArray[np.float64]) -> NDArray[np.int64]:
    """A number (N,) for each row of (N, K), the same for equal rows; quicker than np.unique."""
    order = np.lexsort(values.T)
    differs = (values[order][1:] != values[order][:-1]).any(axis=1)
    out = np.zeros(len(values), dtype=np.int64)
    out[order[1:]] = np.cumsum(differs)
    return out


GRAPH_MARKERS = Decoder("closures", _graph)
