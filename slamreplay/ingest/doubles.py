"""Tags that a detector told twice: in a message and on tf."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.manifest import Loss
from slamreplay.ingest.rows import TopicRows


def without_doubles(
    seen: Sequence[TopicRows], topics: Sequence[TopicRows]
) -> tuple[list[TopicRows], list[TopicRows], list[Loss]]:
    """Both with each sighting once, and how many were left out.

    Of two under one name the message's is kept, which may carry a covariance; under two names tf's
    is, for a survey of the tags on tf knows that name.

    Args:
        seen: sightings on tf.
        topics: topics of any table; references of kind fiducial are looked at.
    """
    told = [t for t in topics if t.table == "references" and "fiducial" in t.columns["kind"]]
    if not seen or not told:
        return list(seen), list(topics), []
    losses: list[Loss] = []
    by_name = {id(t): _keys(t, t.columns["child_frame_id"]) for t in (*seen, *told)}
    by_place = {id(t): _keys(t, np.full(len(t), "", dtype=object)) for t in (*seen, *told)}
    name_told = np.concatenate([by_name[id(t)] for t in told])
    name_seen = np.concatenate([by_name[id(t)] for t in seen])
    place_seen = np.concatenate([by_place[id(t)] for t in seen])
    once = [_without(t, np.isin(by_name[id(t)], name_told), losses) for t in seen]
    others = []
    for topic in topics:
        double = np.zeros(len(topic), dtype=bool)
        if id(topic) in by_name:
            double = np.isin(by_place[id(topic)], place_seen)
            double &= ~np.isin(by_name[id(topic)], name_seen)
        others.append(_without(topic, double, losses))
    return once, others, losses


def _keys(topic: TopicRows, names: NDArray[np.object_]) -> NDArray[np.str_]:
    """(N,) what makes two rows the same sighting: stamp, place to a micrometre, and the name."""
    place = np.rint(topic.columns["position_xyz"] * 1e6).astype(np.int64)
    rows = zip(topic.t_sensor_ns.tolist(), place.tolist(), names, strict=True)
    return np.array([f"{t} {xyz} {name}" for t, xyz, name in rows], dtype=str)


def _without(topic: TopicRows, double: NDArray[np.bool_], losses: list[Loss]) -> TopicRows:
    if not double.any():
        return topic
    reason = "tags told twice, in a message and on tf"
    losses.append(Loss(kind="skipped", what=topic.topic, count=int(double.sum()), reason=reason))
    return topic.take(np.flatnonzero(~double))
