"""People who walk about the robot and hide beams."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from slamreplay.bundle.view import BundleView
from slamreplay.errors import NotApplicableError
from slamreplay.perturb.beams import scan_beams
from slamreplay.perturb.passers import Met, Passers
from slamreplay.perturb.variant import Variant, check_level

#: People are drawn in groups, of one for each second of the log and so many more but no more than
#: so many, and in no more groups than this: by then few beams are left to stand in front of.
_MORE, _MOST, _GROUPS = 20, 2000, 40
_NOBODY = np.iinfo(np.int64).max


@dataclass(frozen=True)
class People:
    """Let people walk past the robot until they hide a share of the beams.

    Each is a disc that walks straight on through the frame of odometry, at a walking pace, past a
    place beside the robot. Walls do not stop them: behind one they hide nothing. A beam that they
    hide tells the range to them. A higher level with the same seed has the same people and more;
    the last of them leaves when the share is reached.
    """

    name: ClassVar[str] = "people"
    variants: ClassVar[dict[str, Variant]] = {
        "hidden": Variant("ratio", 0.0, "people hide this share of the valid beams", 0, 0.9),
    }
    touches: ClassVar[frozenset[str]] = frozenset({"scans"})

    def apply(
        self, view: BundleView, variant: str, level: float, rng: np.random.Generator
    ) -> BundleView:
        """The view with people in its scans.

        Raises:
            NotApplicableError: the log has no scans or no odometry, or its scans see too little
                room for people to hide so much.
            UsageError: the level is out of range.
        """
        if level == check_level(self.name, self.variants, variant, level).baseline:
            return view
        beams = scan_beams(view, self.name)
        passers = Passers.about(view, beams, self.name)
        hits, misses = beams.returns
        free_to = np.where(misses, beams.spread(beams.table["range_max_m"]), 0.0)
        free_to = np.where(hits, beams.ranges_m, free_to).astype(np.float32)
        valid = np.count_nonzero(hits) + np.count_nonzero(misses)
        wanted = round(level * valid)
        if not wanted:
            return view
        by = np.full(len(free_to), _NOBODY)
        size = min(int(passers.t_s[-1]), _MOST) + _MORE
        found: list[Met] = []
        while np.count_nonzero(by != _NOBODY) < wanted:
            if len(found) == _GROUPS:
                share = np.count_nonzero(by != _NOBODY) / valid
                raise NotApplicableError(
                    f"people can hide {share:.2f} of the beams, not {level:g}", where=self.name
                )
            met = passers.draw(size, rng)
            near = met.range_m < free_to[met.beam]
            who = met.who[near] + size * len(found)
            found.append(Met(met.beam[near], who, met.range_m[near]))
            np.minimum.at(by, found[-1].beam, who)
        hidden = np.cumsum(np.bincount(by[by != _NOBODY]))
        last = int(np.searchsorted(hidden, wanted))
        own = np.flatnonzero(by == last)
        until = own[len(own) - 1 - (int(hidden[last]) - wanted)]
        ranges = beams.ranges_m.copy()
        for met in found:
            there = (met.who < last) | ((met.who == last) & (met.beam <= until))
            np.minimum.at(ranges, met.beam[there], met.range_m[there])
        return beams.with_ranges(ranges)
