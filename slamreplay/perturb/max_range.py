"""A laser that does not reach as far."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.no_return import told_as_range_max
from slamreplay.bundle.view import BundleView
from slamreplay.perturb.beams import Beams, scan_beams
from slamreplay.perturb.variant import Variant, check_level

#: No planar lidar on a robot reaches so far: a limit there leaves every log as it is.
_BEYOND_M = 1000.0


@dataclass(frozen=True)
class MaxRange:
    """Returns from farther away are not had: the beam tells what this laser tells of no return.

    That is +inf where the log has it, range_max where the driver writes that, and NaN where it
    writes anything else (0, NaN, more than range_max), which does not tell the free from the
    invalid. A log in which every beam comes back gets +inf, as REP 117 has it.
    """

    name: ClassVar[str] = "max_range"
    variants: ClassVar[dict[str, Variant]] = {
        "share": Variant("ratio", 1.0, "the laser reaches this share of its range_max", 0.001, 1),
        "limit": Variant("m", _BEYOND_M, "the laser reaches no farther than this", 0.01, _BEYOND_M),
    }
    touches: ClassVar[frozenset[str]] = frozenset({"scans"})

    def apply(
        self,
        view: BundleView,
        variant: str,
        level: float,
        rng: np.random.Generator,  # noqa: ARG002 - nothing is random
    ) -> BundleView:
        """The view with a shorter reach; as it is where the laser reaches no farther anyway.

        Raises:
            NotApplicableError: the log has no scans.
            UsageError: the level is out of range.
        """
        if level == check_level(self.name, self.variants, variant, level).baseline:
            return view
        beams = scan_beams(view, self.name)
        own = beams.table["range_max_m"]
        reach = own * level if variant == "share" else np.minimum(own, level)
        if bool((reach == own).all()):
            return view
        hits, misses = beams.returns
        ranges, far = beams.ranges_m.copy(), beams.spread(reach)
        code = told_as_range_max(ranges, beams.spread(own))
        beyond = hits & (ranges > far)
        if code.any():
            told = np.broadcast_to(far.astype(np.float32), ranges.shape)
            ranges[code | beyond] = told[code | beyond]
        else:
            ranges[beyond] = _no_return(beams, hits, misses)
        return beams.with_ranges(ranges, reach)


def _no_return(beams: Beams, hits: NDArray[np.bool_], misses: NDArray[np.bool_]) -> float:
    """What the laser writes of a beam that does not come back, where that is not range_max."""
    if misses.any():
        return np.inf
    odd = ~hits & ~(beams.ranges_m > 0.0)
    odd |= beams.ranges_m > beams.spread(beams.table["range_max_m"])
    return np.nan if odd.any() else np.inf
