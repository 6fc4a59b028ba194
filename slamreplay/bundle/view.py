"""A bundle to read, and a view of it: the same evidence with at most one perturbation."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from types import MappingProxyType

import numpy as np

from slamreplay.bundle.manifest import Manifest
from slamreplay.bundle.schema import JUDGING_KINDS, SENSED_KINDS, TABLES
from slamreplay.bundle.store import read_grid, read_manifest, read_table
from slamreplay.bundle.tables import Table
from slamreplay.errors import UsageError
from slamreplay.geometry.transforms import Edge, TransformBuffer
from slamreplay.maps.grid import OccupancyGrid


def check_held_out(kinds: Collection[str]) -> None:
    """Refuse kinds of references that no view can hold out.

    Raises:
        UsageError: a kind that only judges anyway, or none at all.
    """
    for kind in kinds:
        if kind not in SENSED_KINDS:
            known = ", ".join(sorted(SENSED_KINDS))
            raise UsageError(f"'{kind}' cannot be held out", hint=f"there are: {known}")


class Bundle:
    """Read-only handle of a bundle; tables are read and checked when first asked for.

    Args:
        manifest: what it says about itself.
        tables: tables in memory, by name; those on disk are read on demand.
        grids: maps in memory, by version.
        path: the folder on disk, None for a bundle that lives in memory only (tests, notebooks).
    """

    def __init__(
        self,
        manifest: Manifest,
        tables: Mapping[str, Table],
        grids: Mapping[str, OccupancyGrid],
        path: Path | None = None,
    ) -> None:
        self.manifest = manifest
        self.path = path
        self._tables = dict(tables)
        self._grids = dict(grids)

    @classmethod
    def open(cls, path: Path) -> Bundle:
        """The bundle in a folder.

        Raises:
            BundleError: it is not one, or not whole.
        """
        return cls(read_manifest(path), {}, {}, path)

    def table(self, name: str) -> Table:
        """A table by name, references of every kind included."""
        if name not in self._tables:
            on_disk = self.path is not None
            self._tables[name] = (
                read_table(self.path, self.manifest, name)
                if self.path is not None and on_disk
                else Table.empty(TABLES[name])
            )
        return self._tables[name]

    def grid(self) -> OccupancyGrid | None:
        """The active map: the newest version the manifest lists, or None."""
        if not self.manifest.maps:
            return None
        entry = self.manifest.maps[-1]
        if entry.version not in self._grids and self.path is not None:
            self._grids[entry.version] = read_grid(self.path, entry)
        return self._grids[entry.version]

    def view(self, hold_out: Collection[str] = ()) -> BundleView:
        """The evidence as it was recorded, without references of the kinds that are held out.

        Raises:
            UsageError: a kind that only judges anyway, or none at all.
        """
        check_held_out(hold_out)
        return BundleView(self, held_out=frozenset(hold_out))


@dataclass(frozen=True, eq=False)
class BundleView:
    """The evidence an estimator may read. References that only judge are not in it.

    Attributes:
        bundle: what lies beneath.
        tables: tables a perturbation has exchanged.
        replaced_grid: a map a perturbation has exchanged.
        settings: estimator settings a perturbation has changed, by name.
        held_out: kinds of references that are left out beside those that only judge.
    """

    bundle: Bundle
    tables: Mapping[str, Table] = field(default_factory=lambda: MappingProxyType({}))
    replaced_grid: OccupancyGrid | None = None
    settings: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    held_out: frozenset[str] = frozenset()

    @property
    def manifest(self) -> Manifest:
        """The bundle's manifest."""
        return self.bundle.manifest

    def table(self, name: str) -> Table:
        """A table by name; of references only those the robot itself sensed."""
        if name in self.tables:
            return self.tables[name]
        table = self.bundle.table(name)
        if name == "references":
            return table.take(
                ~np.isin(table["kind"].astype(str), sorted(JUDGING_KINDS | self.held_out))
            )
        return table

    def role(self, role: str) -> Table | None:
        """The rows of the topic that plays `role` in its table, or None where none does."""
        topic = self.manifest.topic_of(role)
        if topic is None:
            return None
        table = self.table(ROLE_TABLES[role])
        return table.take(table["topic"] == topic)

    @cached_property
    def grid(self) -> OccupancyGrid | None:
        """The active map."""
        return self.bundle.grid() if self.replaced_grid is None else self.replaced_grid

    @cached_property
    def transforms(self) -> TransformBuffer:
        """The tf tree of this view."""
        return TransformBuffer(edges_of(self.table("transforms")))

    def with_table(self, table: Table) -> BundleView:
        """A view with one table exchanged."""
        return replace(self, tables={**self.tables, table.schema.name: table})

    def with_grid(self, grid: OccupancyGrid) -> BundleView:
        """A view with the map exchanged."""
        return replace(self, replaced_grid=grid)

    def with_setting(self, name: str, value: float) -> BundleView:
        """A view that asks estimators to run with one setting changed."""
        return replace(self, settings={**self.settings, name: value})


#: Which table the topic of a role has its rows in.
ROLE_TABLES = {
    "odometry": "odometry",
    "imu": "imu",
    "scan": "scans",
    "scan_2": "scans",
    "points": "points",
    "pose": "poses",
    "covariance": "poses",
    "initial_pose": "initial_poses",
    "particles": "particles",
    "costmap": "costmaps",
    "plan": "plans",
    "command": "commands",
    "velocity": "velocities",
    "joints": "joints",
    "magnetic_field": "magnetic_fields",
    "quality": "signals",
    "clock": "clock",
    "closure": "closures",
    "recovery": "recoveries",
    "reference": "references",
    "map": "map_updates",
}


def edges_of(transforms: Table) -> list[Edge]:
    """Edges of a transforms table: sorted, of repeated stamps the last row kept."""
    parents, children = transforms["parent_frame"], transforms["child_frame"]
    edges = []
    for parent, child in sorted(set(zip(parents, children, strict=True))):
        rows = np.flatnonzero((parents == parent) & (children == child))
        is_static = bool(transforms["is_static"][rows].all())
        rows = rows[np.argsort(transforms.t_ns[rows], kind="stable")]
        t = transforms.t_ns[rows]
        rows = rows[np.append(t[1:] != t[:-1], True)]
        edges.append(
            Edge(
                parent,
                child,
                transforms.t_ns[rows],
                transforms["translation_xyz"][rows],
                transforms["rotation_xyzw"][rows],
                is_static,
            )
        )
    return edges
