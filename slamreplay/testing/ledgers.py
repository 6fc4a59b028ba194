"""What the kit demands of a residual ledger."""

from __future__ import annotations

import numpy as np

from slamreplay.bundle.run import Estimate, Innovations
from slamreplay.bundle.view import Bundle
from slamreplay.geometry.covariance import is_positive_definite
from slamreplay.geometry.times import NS_PER_S
from slamreplay.testing.conformance import demand


def check_ledger(name: str, estimate: Estimate, bundle: Bundle) -> None:
    """Raise ConformanceError unless every set is whole, and says how far it moved the belief.

    Shapes fit; times lie in the log; where S is what the estimator predicted it is a covariance,
    and the residual finite; scores are from 0 to 1; what was taken in, and told its residual, also
    tells how far it moved a belief that was there before.

    Args:
        name: of the estimator, for the message.
        estimate: what it gave.
        bundle: of what.
    """
    known = estimate.track.t_ns[estimate.track.has_pose]
    span = bundle.manifest.start_ns - NS_PER_S, bundle.manifest.end_ns + NS_PER_S
    names = [one.source for one in estimate.innovations]
    demand(len(set(names)) == len(names), f"{name} has two sets of one source in its ledger")
    for one in estimate.innovations:
        where = f"{name}, ledger of '{one.source}'"
        demand(one.source, f"{name} has a set without a source in its ledger")
        _shapes_fit(where, one)
        inside = (one.t_ns >= span[0]) & (one.t_ns <= span[1])
        demand(inside.all(), f"{where}: a time lies outside of the log")
        if one.is_predicted:
            demand(
                np.isfinite(one.residual).all() and is_positive_definite(one.S).all(),
                f"{where}: S is said to be predicted and a row of it is no covariance (or its "
                "residual not finite): leave it out, or say is_predicted=False",
            )
        score = one.score[np.isfinite(one.score)]
        demand(((score >= 0.0) & (score <= 1.0)).all(), f"{where}: a score is not from 0 to 1")
        told = np.isfinite(one.residual).all(axis=1) & one.accepted
        told &= (one.t_ns > known[0]) if len(known) else False
        demand(
            np.isfinite(one.moved[told]).all(),
            f"{where}: a measurement that was taken in does not say how far it moved the belief",
        )


def ledger_before(estimate: Estimate, t_ns: int) -> dict[str, bytes]:
    """Every row of the ledger before a time, bit by bit, by source; empty sets are left out."""
    found = {}
    for one in estimate.innovations:
        rows = one.t_ns < t_ns
        if rows.any():
            columns = (one.t_ns, one.residual, one.S, one.accepted, one.moved, one.score)
            told = b"".join(np.ascontiguousarray(column[rows]).tobytes() for column in columns)
            found[one.source] = told + "\0".join(one.about[rows].tolist()).encode()
    return found


def _shapes_fit(where: str, one: Innovations) -> None:
    n = len(one.t_ns)
    m = np.shape(one.residual)[1] if np.ndim(one.residual) == 2 else 0
    shapes = {
        "residual": (n, m),
        "S": (n, m, m),
        "accepted": (n,),
        "moved": (n, 3),
        "about": (n,),
        "score": (n,),
    }
    for name, shape in shapes.items():
        given = np.shape(getattr(one, name))
        demand(m and given == shape, f"{where}: {name} is of shape {given}, expected {shape}")
    demand(len(one.axes) == m, f"{where}: {len(one.axes)} axes are named, {m} were measured")
