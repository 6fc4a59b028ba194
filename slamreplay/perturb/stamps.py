"""The stamps that one source gave, to be moved wherever they occur."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.view import BundleView
from slamreplay.geometry.times import Times
from slamreplay.perturb.beams import scan_rows
from slamreplay.perturb.odometry_rows import odometry_rows


@dataclass(frozen=True, eq=False)
class Stamps:
    """The distinct times of one source's rows, in one table or in several.

    Attributes:
        view: what they are of.
        rows: by table, the mask of the rows that are meant.
        t_ns: (N,) distinct times on the bundle's clock, ascending.
    """

    view: BundleView
    rows: Mapping[str, NDArray[np.bool_]]
    t_ns: Times

    def moved(self, by_ns: NDArray[np.int64]) -> BundleView:
        """The view in which each of the times (N,) is later by so much.

        As in a log whose header stamps are wrong: what was recorded of stamps and of when messages
        arrived stays, only what estimation runs on changes.
        """
        view = self.view
        for name, mask in self.rows.items():
            if mask.any():
                table = view.table(name)
                t_ns = table.t_ns.copy()
                t_ns[mask] += by_ns[np.searchsorted(self.t_ns, t_ns[mask])]
                view = view.with_table(table.replace(t_ns=t_ns))
        return view


def scan_stamps(view: BundleView, name: str) -> Stamps:
    """Those of the laser that plays the scan role.

    Raises:
        NotApplicableError: the log has no scans.
    """
    mask = np.zeros(len(view.table("scans")), dtype=bool)
    mask[scan_rows(view, name)] = True
    return _stamps(view, {"scans": mask})


def odometry_stamps(view: BundleView, name: str) -> Stamps:
    """Those of odometry, which has one stamp for its message and its transform.

    Raises:
        NotApplicableError: the log has no odometry.
    """
    return _stamps(view, odometry_rows(view, name))


def _stamps(view: BundleView, rows: Mapping[str, NDArray[np.bool_]]) -> Stamps:
    times = [view.table(name).t_ns[mask] for name, mask in rows.items()]
    return Stamps(view, rows, np.unique(np.concatenate(times)))
