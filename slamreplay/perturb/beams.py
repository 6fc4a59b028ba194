"""Every beam of the laser that plays the scan role, to be changed and put back."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.scans import hits_and_misses
from slamreplay.bundle.tables import Ragged, Table
from slamreplay.bundle.view import BundleView
from slamreplay.errors import NotApplicableError
from slamreplay.geometry import se2

#: The least of a turn that a field of view lacks before it has two edges, in beams: one scan in
#: which the last beam is the neighbour of the first goes all around.
_SEAM_BEAMS = 1.5


@dataclass(frozen=True, eq=False)
class Beams:
    """The scans of one laser, beam by beam; of other lasers nothing is touched.

    Attributes:
        view: what they are of.
        rows: (N,) rows of table `scans`, ascending.
        table: (N) these rows.
        ranges_m: (M,) float32 as recorded, one scan after the other.
    """

    view: BundleView
    rows: NDArray[np.int64]
    table: Table
    ranges_m: NDArray[np.float32]

    @property
    def lengths(self) -> NDArray[np.int64]:
        """(N,) beams of each scan."""
        return self._ragged.lengths

    def spread(self, numbers: NDArray[Any]) -> NDArray[Any]:
        """One number a scan (N,) as one a beam (M,), or (1,) where all scans have the same."""
        return self._ragged.spread(numbers)

    @cached_property
    def index(self) -> NDArray[np.int64]:
        """(M,) number of each beam within its scan."""
        return np.arange(len(self.ranges_m)) - np.repeat(self._ragged.offsets[:-1], self.lengths)

    @cached_property
    def returns(self) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """(M,) beams with a valid return, and those that saw free space to the end."""
        low, high = (self.spread(self.table[name]) for name in ("range_min_m", "range_max_m"))
        return hits_and_misses(self.ranges_m, low, high)

    @cached_property
    def field_rad(self) -> se2.Array:
        """(N,) field of view: from the first beam to the last, or all around."""
        step, n = np.abs(self.table["angle_increment_rad"]), self.lengths
        is_round = (n - 1 + _SEAM_BEAMS) * step >= 2.0 * np.pi
        return np.where(is_round, 2.0 * np.pi, np.maximum(n - 1, 0) * step)

    @cached_property
    def off_middle_rad(self) -> se2.Array:
        """(M,) angle between each beam and the middle of its scan's field of view.

        A scan that goes all around has no edges: its middle is the laser's x axis, which points
        ahead (REP 103), wherever the first beam is.
        """
        first, step = self.table["angle_min_rad"], self.table["angle_increment_rad"]
        is_round = self.field_rad >= 2.0 * np.pi
        middle = np.where(is_round, 0.0, first + step * (self.lengths - 1) / 2.0)
        off = self.spread(first - middle) + self.index * self.spread(step)
        return np.abs(se2.wrap_angle(off))

    def with_returns(self, ranges_m: NDArray[np.float32]) -> BundleView:
        """The view with ranges (H,) in place of those of the beams with a valid return.

        One that is no length any more is lost; one outside of what the laser takes for valid is
        invalid, for nothing else about the scan changes.
        """
        changed = self.ranges_m.copy()
        changed[self.returns[0]] = np.where(ranges_m > 0.0, ranges_m, np.nan)
        return self.with_ranges(changed)

    def without(self, lost: NDArray[np.bool_]) -> BundleView:
        """The view in which the beams of a mask (M,) are invalid: NaN, which says nothing.

        Not +inf, which would say that there is free space (REP 117).
        """
        return self.with_ranges(np.where(lost, np.float32(np.nan), self.ranges_m))

    def with_ranges(
        self, ranges_m: NDArray[np.float32], range_max_m: NDArray[np.float64] | None = None
    ) -> BundleView:
        """The view with all of these beams exchanged (M,), and range_max (N,) where it is given."""
        whole = self.view.table("scans")
        old: Ragged = whole["ranges_m"]
        own = np.zeros(len(whole), dtype=bool)
        own[self.rows] = True
        values = ranges_m
        if not own.all():
            values = old.values.copy()
            values[np.repeat(own, old.lengths)] = ranges_m
        columns: dict[str, Any] = {"ranges_m": Ragged(values, old.offsets)}
        if range_max_m is not None:
            columns["range_max_m"] = whole["range_max_m"].copy()
            columns["range_max_m"][self.rows] = range_max_m
        return self.view.with_table(whole.replace(**columns))

    @property
    def _ragged(self) -> Ragged:
        return self.table["ranges_m"]


def scan_rows(view: BundleView, name: str) -> NDArray[np.int64]:
    """(N,) rows of table `scans` of the laser that plays the scan role, ascending.

    Raises:
        NotApplicableError: there are none.
    """
    rows = np.flatnonzero(view.table("scans")["topic"] == view.manifest.topic_of("scan"))
    if not len(rows):
        raise NotApplicableError("the log has no scans", where=name)
    return rows


def scan_beams(view: BundleView, name: str) -> Beams:
    """The beams of the laser that plays the scan role.

    Raises:
        NotApplicableError: the log has no scans, or they hold no beam.
    """
    rows = scan_rows(view, name)
    whole = view.table("scans")
    table = whole if len(rows) == len(whole) else whole.take(rows)
    beams = Beams(view, rows, table, table["ranges_m"].values)
    if not len(beams.ranges_m):
        raise NotApplicableError("the log's scans hold no beam", where=name)
    return beams
