"""Wheels of another size than the robot thinks, or another distance apart."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from slamreplay.bundle.view import BundleView
from slamreplay.geometry.se2 import Array
from slamreplay.geometry.times import Times
from slamreplay.perturb.odometry_path import retold, turns_of, with_odometry
from slamreplay.perturb.variant import Variant, check_level


@dataclass(frozen=True)
class OdometryScale:
    """Scale every step of odometry, on tf and on the topic alike."""

    name: ClassVar[str] = "odometry_scale"
    variants: ClassVar[dict[str, Variant]] = {
        "translation": Variant("ratio", 1.0, "reported over driven distance", 0, 10),
        "rotation": Variant("ratio", 1.0, "reported over turned angle", 0, 10),
    }
    touches: ClassVar[frozenset[str]] = frozenset({"odometry", "transforms"})

    def apply(
        self,
        view: BundleView,
        variant: str,
        level: float,
        rng: np.random.Generator,  # noqa: ARG002 - nothing is random
    ) -> BundleView:
        """The view with other odometry.

        Raises:
            NotApplicableError: the log has no odometry.
            UsageError: the level is out of range.
        """
        if level == check_level(self.name, self.variants, variant, level).baseline:
            return view
        length, turn = (level, 1.0) if variant == "translation" else (1.0, level)

        def change(_: Times, xyyaw: Array) -> Array:
            return retold(xyyaw, length, turn * turns_of(xyyaw)[:, 2])

        def twists(_: Times, linear: Array, angular: Array) -> tuple[Array, Array]:
            return length * linear, turn * angular

        return with_odometry(view, self.name, change, twists)
