"""A robot that drives by an older map than it could."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from slamreplay.bundle.view import BundleView
from slamreplay.errors import NotApplicableError, UsageError
from slamreplay.geometry.times import ns
from slamreplay.perturb.held_maps import held_maps
from slamreplay.perturb.variant import Variant, check_level


@dataclass(frozen=True)
class MapStale:
    """Put an older version of the map in the place of each; the first one stays what it is.

    Versions of another place (the log's maps of another floor, say) do not count as older ones.
    """

    name: ClassVar[str] = "map_stale"
    variants: ClassVar[dict[str, Variant]] = {
        "versions": Variant("ratio", 0.0, "so many versions older, a whole number", 0, 1000),
        "age": Variant("s", 0.0, "at any time the map that held so long before", 0, 1e6),
    }
    touches: ClassVar[frozenset[str]] = frozenset({"map", "map_updates"})

    def apply(
        self,
        view: BundleView,
        variant: str,
        level: float,
        rng: np.random.Generator,  # noqa: ARG002 - nothing is random
    ) -> BundleView:
        """The view with older maps.

        Raises:
            NotApplicableError: the log has no map, or no version that is so old.
            UsageError: the level is out of range, or no whole number of versions.
        """
        if level == check_level(self.name, self.variants, variant, level).baseline:
            return view
        if variant == "versions" and level != round(level):
            raise UsageError(f"level {level:g} of 'map_stale.versions' is not a whole number")
        grids = held_maps(view, self.name)
        if len(grids) < 2:
            raise NotApplicableError("the log has one version of its map", where=self.name)
        if variant == "age":
            updates = view.table("map_updates")
            return view.with_table(updates.replace(t_ns=updates.t_ns + ns(level)))
        older: dict[str, str] = {}
        back = int(level)
        for stretch in reversed(view.map_stretches):
            last = reversed(dict.fromkeys(held.version for held in reversed(stretch.held)))
            versions = list(last)
            if stretch is view.map_stretches[-1] and back >= len(versions):
                there = f"{len(versions)} version{'s' if len(versions) > 1 else ''}"
                raise NotApplicableError(
                    f"the log's last map has {there}, none is {back} older", where=self.name
                )
            for k, version in enumerate(versions):
                older.setdefault(version, versions[max(k - back, 0)])
        return view.with_grids({new: grids[old] for new, old in older.items() if new != old})
