"""A wrong start."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from slamreplay.bundle.view import BundleView
from slamreplay.errors import UsageError
from slamreplay.perturb.variant import Variant, check_level


@dataclass(frozen=True)
class InitialPose:
    """Start the estimator elsewhere than the log does; later initial poses stay as they are."""

    name: ClassVar[str] = "initial_pose"
    variants: ClassVar[dict[str, Variant]] = {
        "offset": Variant("m", 0.0, "start this far ahead, along the start's heading", -1e4, 1e4),
        "rotate": Variant("deg", 0.0, "start turned to the left by this much", -180, 180),
        "global": Variant("ratio", 0.0, "1: start anywhere in the map", 0, 1),
    }
    touches: ClassVar[frozenset[str]] = frozenset(
        {"initial_pose_offset_m", "initial_pose_rotate_rad", "initial_pose_global"}
    )

    def apply(
        self,
        view: BundleView,
        variant: str,
        level: float,
        rng: np.random.Generator,  # noqa: ARG002 - nothing is random
    ) -> BundleView:
        """The view with the setting that estimators honour.

        Raises:
            UsageError: the level is out of range.
        """
        if level == check_level(self.name, self.variants, variant, level).baseline:
            return view
        if variant == "offset":
            return view.with_setting("initial_pose_offset_m", level)
        if variant == "rotate":
            return view.with_setting("initial_pose_rotate_rad", float(np.radians(level)))
        if level != 1.0:
            raise UsageError(f"level {level:g} of 'initial_pose.global' is neither 0 nor 1")
        return view.with_setting("initial_pose_global", 1.0)
