"""What kind of change an area is: of the changed regions that logs found there."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from slamreplay.fleet.counted import Counted
from slamreplay.fleet.gathered import Gathered
from slamreplay.geometry import se2

if TYPE_CHECKING:
    from slamreplay.fleet.snapshot import Snapshot

#: Regions within an area are of one kind if so many are.
ONE_KIND = 2.0 / 3.0


class Kinds:
    """The changed regions of all logs that count, by map."""

    def __init__(self, now: Snapshot, logs: Counted, found: Gathered) -> None:
        self._by_map = dict(_regions(now, logs, found))

    def within(self, map_index: int, box_m: tuple[float, float, float, float]) -> str | None:
        """What most of those are that touch a box."""
        if map_index not in self._by_map:
            return None
        kind, boxes = self._by_map[map_index]
        x_min, y_min, x_max, y_max = box_m
        touch = (boxes[:, 0] < x_max) & (boxes[:, 2] > x_min)
        touch &= (boxes[:, 1] < y_max) & (boxes[:, 3] > y_min)
        names, counts = np.unique(kind[touch].astype(str), return_counts=True)
        if not len(names):
            return None
        most = int(np.argmax(counts))
        return str(names[most]) if counts[most] >= ONE_KIND * counts.sum() else "mixed"


def _regions(
    now: Snapshot, logs: Counted, found: Gathered
) -> Iterator[tuple[int, tuple[NDArray[np.object_], se2.Array]]]:
    """By map: kinds (R,) and boxes (R, 4)."""
    number = {name: k for k, name in enumerate(found.maps)}
    judged = {
        key: site
        for key, site, is_judged in zip(
            logs.texts["key"].tolist(),
            logs.texts["site"].tolist(),
            logs.judged.tolist(),
            strict=True,
        )
        if is_judged
    }
    columns = ("key", "map_version", "kind", "x_min_m", "y_min_m", "x_max_m", "y_max_m")
    by_map: dict[int, list[tuple[str, list[float]]]] = {}
    for table in now.tables("regions", columns):
        for key, version, kind, *box in zip(
            *(table[name].to_pylist() for name in columns), strict=True
        ):
            if key in judged and (judged[key], version) in number:
                by_map.setdefault(number[judged[key], version], []).append((kind, box))
    for map_index, rows in by_map.items():
        kinds = np.array([kind for kind, _ in rows], dtype=object)
        yield map_index, (kinds, np.array([box for _, box in rows], dtype=np.float64))
