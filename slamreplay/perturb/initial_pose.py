"""A wrong start."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from slamreplay.bundle.view import BundleView
from slamreplay.geometry import se2
from slamreplay.perturb.variant import Variant, check_level, switch

#: Settings that estimators honour: metres ahead and to the left, radians to the left, the standard
#: deviation in m that comes to the start's own, and 1 for a start that knows nothing.
_OFFSET, _LEFT = "initial_pose_offset_m", "initial_pose_left_m"
_ROTATE, _SIGMA = "initial_pose_rotate_rad", "initial_pose_sigma_m"
_GLOBAL = "initial_pose_global"
#: Of the heading for each metre: 15 deg for 0.5 m, what rviz sends with a clicked pose.
_RAD_PER_M = np.radians(15.0) / 0.5


@dataclass(frozen=True)
class InitialPose:
    """Start the estimator elsewhere than the log does; later initial poses stay as they are.

    `ambiguous` draws the start from how well it is known, and tells the estimator so: its
    covariance grows by the level squared, that of the heading in proportion, as a pose that is
    clicked in rviz has 0.5 m and 15 deg, up to any heading. A higher level with the same seed is
    the same start, farther off.
    """

    name: ClassVar[str] = "initial_pose"
    variants: ClassVar[dict[str, Variant]] = {
        "offset": Variant("m", 0.0, "start this far ahead, along the start's heading", -1e4, 1e4),
        "aside": Variant("m", 0.0, "start this far to the left of the start's heading", -1e4, 1e4),
        "rotate": Variant(
            "deg", 0.0, "start turned to the left by this much; 180 faces the other way", -180, 180
        ),
        "ambiguous": Variant(
            "m",
            0.0,
            "start known to this standard deviation only, and to 30 deg for each m",
            0,
            1e4,
        ),
        "global": switch("start anywhere in the map"),
    }
    touches: ClassVar[frozenset[str]] = frozenset({_OFFSET, _LEFT, _ROTATE, _SIGMA, _GLOBAL})

    def apply(
        self,
        view: BundleView,
        variant: str,
        level: float,
        rng: np.random.Generator,
    ) -> BundleView:
        """The view with the setting that estimators honour.

        Raises:
            UsageError: the level is out of range.
        """
        if level == check_level(self.name, self.variants, variant, level).baseline:
            return view
        if variant == "ambiguous":
            ahead, left, turn = rng.standard_normal(3)
            view = view.with_setting(_OFFSET, level * float(ahead))
            view = view.with_setting(_LEFT, level * float(left))
            turned = level * _RAD_PER_M * float(turn)
            view = view.with_setting(_ROTATE, float(se2.wrap_angle(turned)))
            return view.with_setting(_SIGMA, level)
        if variant == "rotate":
            return view.with_setting(_ROTATE, float(np.radians(level)))
        name = {"offset": _OFFSET, "aside": _LEFT, "global": _GLOBAL}[variant]
        return view.with_setting(name, level)
