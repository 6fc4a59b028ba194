"""Errors against things that stand still at a place which is not known exactly, or not at all.

What is not known of a thing's place is the same in every sighting of it. Were it counted with each,
as if it were drawn anew, one survey that is off by two of its sigmas would look like a hundred
belief updates that are. So each sighting is held against what was known of the place before it: the
survey, and the sightings until then.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slamreplay.geometry import se2
from slamreplay.geometry.times import ns

#: Sightings nearer in time than this are one visit.
VISIT_S = 10.0


def against_the_past(
    places: se2.Array, cov: se2.Array, prior: se2.Array | None
) -> tuple[se2.Array, se2.Array]:
    """Errors (N, m) and their covariances (N, m, m) of what one thing's sightings say of its place.

    Row i is place i minus the mean of the places before it and of the prior, weighted by their
    information; its covariance is its own plus that of the mean. They are the innovations of a
    Kalman filter whose state stands still, and as white as the places' own errors are (Kailath, An
    innovations approach to least-squares estimation, part I, IEEE Trans. Automatic Control 13,
    1968). Without a prior there is no row of the first place: it says where the thing is.

    Args:
        places: (N, m) relative to where the thing is thought to be, in order of time; headings
            wrapped.
        cov: (N, m, m) of them, positive definite.
        prior: (m, m) covariance of where it is thought to be; None where nobody told.
    """
    n, m = places.shape
    start = 1 if prior is None else 0
    identity = np.eye(m)
    # Sums of information are what a recursion over the rows would do one by one.
    information = np.linalg.solve(cov, np.broadcast_to(identity, cov.shape))
    known = np.zeros((m, m)) if prior is None else np.linalg.solve(prior, identity)
    before = known + np.cumsum(information, axis=0) - information
    weighted = np.einsum("nij,nj->ni", information, places)
    sums = np.cumsum(weighted, axis=0) - weighted
    mean = np.linalg.solve(before[start:], sums[start:, :, None])[..., 0]
    mean_cov = np.linalg.solve(before[start:], np.broadcast_to(identity, (n - start, m, m)))
    mean_cov = 0.5 * (mean_cov + np.swapaxes(mean_cov, 1, 2))
    return places[start:] - mean, cov[start:] + mean_cov


def visits(t_ns: NDArray[np.int64]) -> NDArray[np.int64]:
    """Rows of sorted times (N,), each at least `VISIT_S` after the one taken before it."""
    rows: list[int] = []
    at = 0
    while at < len(t_ns):
        rows.append(at)
        at = int(np.searchsorted(t_ns, t_ns[at] + ns(VISIT_S)))
    return np.array(rows, dtype=np.int64)


def things(places: se2.Array, within_m: float, within_rad: float) -> NDArray[np.int64]:
    """(N,) which thing each place (N, 3) is of, numbered as they first appear.

    A place belongs to the nearest thing whose first place is within both limits; a heading of NaN
    fits any.
    """
    firsts: list[se2.Array] = []
    label = np.zeros(len(places), dtype=np.int64)
    for i, place in enumerate(places):
        step = np.array(firsts).reshape(-1, 3) - place
        distance, turn = np.hypot(step[:, 0], step[:, 1]), np.abs(se2.wrap_angle(step[:, 2]))
        fits = (distance <= within_m) & ~(turn > within_rad)
        if fits.any():
            label[i] = int(np.argmin(np.where(fits, distance, np.inf)))
        else:
            label[i] = len(firsts)
            firsts.append(place)
    return label
