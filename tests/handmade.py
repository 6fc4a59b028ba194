"""Hindsight made by hand, for tests that judge synthetic bundles of known truth."""

import numpy as np

from slamreplay.bundle.products import ChangedRegion, Changes, Hindsight
from slamreplay.bundle.track import PoseTrack
from slamreplay.testing.synthetic import START_NS, room_grid, true_path


def at_scans(bundle):
    return bundle.view().role("scan").t_ns


def hindsight_of(bundle, *, xyyaw=None, match=0.95, margin=0.3, sigma=0.03, shares=None):
    """Hindsight as good as one could wish, unless told otherwise."""
    t = at_scans(bundle)
    n = len(t)
    xyyaw = true_path((t - START_NS) / 1e9) if xyyaw is None else xyyaw
    cov = np.tile(np.diag([sigma**2, sigma**2, 0.01**2]), (n, 1, 1))
    shares = np.zeros(n) if shares is None else np.asarray(shares, dtype=float)
    region = ChangedRegion("appeared", (1.0, 2.0, 2.0, 3.0), 0.8, START_NS, START_NS, 9, 0.9)
    cells = np.zeros(room_grid().cells.shape, dtype=bool)
    changes = Changes(
        cells, cells, (region,) if shares.any() else (), t, shares, shares, np.zeros(n)
    )
    track = PoseTrack("map", "base_link", t, xyyaw, cov)
    return Hindsight(track, sigma, 1.0, np.broadcast_to(float(match), n), margin, changes)


def shares_between(bundle, low_s, high_s, share):
    t = (at_scans(bundle) - START_NS) / 1e9
    return np.where((t >= low_s) & (t < high_s), share, 0.0)
