"""The robot looks up where odometry was some time ago."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from slamreplay.bundle.view import BundleView
from slamreplay.errors import NotApplicableError
from slamreplay.geometry.times import ns
from slamreplay.geometry.transforms import Edge
from slamreplay.perturb.variant import Variant, check_level


@dataclass(frozen=True)
class TfDelay:
    """Stamp transforms later than they were, so that the one found for a scan is `level` old.

    At the start of the log no transform is old enough: there the first `level` seconds of scans
    have none. It is about tf: a log whose odometry is a topic only is not perturbed by it.
    """

    name: ClassVar[str] = "tf_delay"
    variants: ClassVar[dict[str, Variant]] = {
        "odometry": Variant("s", 0.0, "transforms between odometry and base are this old", 0, 60),
        "all": Variant("s", 0.0, "all moving transforms, the localizer's too, are this old", 0, 60),
    }
    touches: ClassVar[frozenset[str]] = frozenset({"transforms"})

    def apply(
        self,
        view: BundleView,
        variant: str,
        level: float,
        rng: np.random.Generator,  # noqa: ARG002 - nothing is random
    ) -> BundleView:
        """The view with later stamps.

        Raises:
            NotApplicableError: tf has no moving transform between odometry and base.
            UsageError: the level is out of range.
        """
        if level == check_level(self.name, self.variants, variant, level).baseline:
            return view
        table = view.table("transforms")
        late = ~table["is_static"]
        moving = moving_odometry(view, self.name)
        if variant == "odometry":
            pairs = {(edge.parent, edge.child) for edge in moving}
            names = zip(table["parent_frame"], table["child_frame"], strict=True)
            late &= np.array([pair in pairs for pair in names], dtype=bool)
        return view.with_table(table.replace(t_ns=table.t_ns + np.where(late, ns(level), 0)))


def moving_odometry(view: BundleView, name: str) -> list[Edge]:
    """The moving transforms between the odometry and the base frame.

    Raises:
        NotApplicableError: tf has none.
    """
    frames = view.manifest.frames
    if frames.odom and frames.base and view.transforms.has_path(frames.odom, frames.base):
        path = view.transforms.path(frames.odom, frames.base)
        moving = [edge for edge in path if not edge.is_static]
        if moving:
            return moving
    raise NotApplicableError("tf has no moving transform between odometry and base", where=name)
