"""The rows by which a log tells odometry: its topic's, and those of tf."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.view import BundleView
from slamreplay.errors import NotApplicableError
from slamreplay.perturb.tf_delay import moving_odometry


def odometry_rows(view: BundleView, name: str) -> dict[str, NDArray[np.bool_]]:
    """Masks of the rows of tables `odometry` and `transforms`.

    Raises:
        NotApplicableError: there are none.
    """
    topic = view.table("odometry")["topic"] == view.manifest.topic_of("odometry")
    tf = view.table("transforms")
    moving = np.zeros(len(tf), dtype=bool)
    try:
        edges = moving_odometry(view, name)
    except NotApplicableError:
        if not topic.any():
            raise NotApplicableError("the log has no odometry", where=name) from None
        edges = []
    for edge in edges:
        moving |= (tf["parent_frame"] == edge.parent) & (tf["child_frame"] == edge.child)
    return {"odometry": np.asarray(topic, dtype=bool), "transforms": moving}
