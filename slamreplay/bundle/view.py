"""A bundle to read, and a view of it: the same evidence with at most one perturbation.

Both stand in one file, long as it is: a bundle gives views, and a view asks its bundle for whatever
it has not exchanged itself.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Hashable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import TypeVar

import numpy as np
import pyarrow.compute as pc

from slamreplay.bundle.arrow import numbers_from_arrow
from slamreplay.bundle.manifest import Manifest
from slamreplay.bundle.map_course import Held, MapStretch, map_course, map_stretches, renamed
from slamreplay.bundle.placeholders import without_placeholders
from slamreplay.bundle.role_tables import ROLE_TABLES
from slamreplay.bundle.schema import JUDGING_KINDS, RELATIONS, SENSED_KINDS, TABLES
from slamreplay.bundle.sharing import Shared
from slamreplay.bundle.store import read_columns, read_grid, read_manifest, read_table
from slamreplay.bundle.tables import Table
from slamreplay.errors import UsageError
from slamreplay.geometry.times import Times
from slamreplay.geometry.transforms import Edge, TransformBuffer
from slamreplay.maps.grid import OccupancyGrid

T = TypeVar("T")


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

    Attributes:
        shared: what was worked out of its tables, for all views that have them as recorded.
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
        self._evidence: dict[str, Table] = {}
        self._grids = dict(grids)
        self._stretches: dict[tuple[Held, ...], tuple[MapStretch, ...]] = {}
        self.shared = Shared()

    @classmethod
    def open(cls, path: Path) -> Bundle:
        """The bundle in a folder.

        Raises:
            BundleError: it is not one, or not whole.
        """
        return cls(read_manifest(path), {}, {}, path)

    def table(self, name: str) -> Table:
        """A table by name as it was recorded, references of every kind included."""
        if name not in self._tables:
            later = self.path is not None and name == RELATIONS and name not in self.manifest.tables
            self._tables[name] = (
                Table.empty(TABLES[name])  # bundles of before there was such a table lack it
                if self.path is None or later
                else read_table(self.path, self.manifest, name)
            )
        return self._tables[name]

    def log_times(self, name: str, topic: str) -> Times:
        """(N,) log times of a topic's rows in a table, without reading the table's numbers."""
        if name in self._tables or self.path is None:
            table = self.table(name)
            return np.asarray(table["t_log_ns"][table["topic"] == topic])
        columns = read_columns(self.path, self.manifest, name, ("topic", "t_log_ns"))
        mine = pc.equal(columns["topic"], topic)
        found = columns["t_log_ns"].filter(mine).combine_chunks()
        return numbers_from_arrow(found, np.int64)

    def evidence(self, name: str) -> Table:
        """A table by name, NaN where a number is only a placeholder (bundle.placeholders)."""
        if name not in self._evidence:
            map_frame = self.manifest.frames.map
            self._evidence[name] = without_placeholders(self.table(name), map_frame)
        return self._evidence[name]

    @property
    def map_versions(self) -> tuple[str, ...]:
        """The map versions that can be had, in the order in which they held last."""
        listed = tuple(entry.version for entry in self.manifest.maps)
        return listed if self.path is not None else tuple(v for v in listed if v in self._grids)

    def grid(self, version: str | None = None) -> OccupancyGrid | None:
        """A map by its version; by default the newest. None where it is not there.

        The newest stays in memory; older ones of a bundle on disk are read each time.
        """
        listed = {entry.version: entry for entry in self.manifest.maps}
        newest = self.manifest.maps[-1].version if listed else None
        version = newest if version is None else version
        if version is None or version not in listed:
            return None
        if version in self._grids or self.path is None:
            return self._grids.get(version)
        grid = read_grid(self.path, listed[version])
        if version == newest:
            self._grids[version] = grid
        return grid

    def map_stretches(self, course: tuple[Held, ...]) -> tuple[MapStretch, ...]:
        """A course of this bundle's maps, cut wherever the place changes; worked out once."""
        if course not in self._stretches:
            self._stretches[course] = map_stretches(course, self.grid)
        return self._stretches[course]

    def grids(self) -> dict[str, OccupancyGrid]:
        """Every map by its version, the newest last."""
        found = {version: self.grid(version) for version in self.map_versions}
        return {version: grid for version, grid in found.items() if grid is not None}

    def view(self, hold_out: Collection[str] = ()) -> BundleView:
        """The evidence as it was recorded, without references of the kinds that are held out.

        Raises:
            UsageError: a kind that only judges anyway, or none at all.
        """
        check_held_out(hold_out)
        return BundleView(self, held_out=frozenset(hold_out))


@dataclass(frozen=True, eq=False)
class BundleView:
    """The evidence an estimator may read: without references that only judge, NaN for placeholders.

    Attributes:
        bundle: what lies beneath.
        tables: tables a perturbation has exchanged.
        replaced_grid: a map that holds all along, in place of those of the bundle.
        redrawn: maps that stand for versions of the bundle, by these versions.
        settings: estimator settings a perturbation has changed, by name.
        held_out: kinds of references that are left out beside those that only judge.
        stretch: the part of the log that is looked at; None is all of it.
        only: the tables that may be read, for work that is to depend on no other; None is all.
    """

    bundle: Bundle
    tables: Mapping[str, Table] = field(default_factory=lambda: MappingProxyType({}))
    replaced_grid: OccupancyGrid | None = None
    redrawn: Mapping[str, OccupancyGrid] = field(default_factory=lambda: MappingProxyType({}))
    settings: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    held_out: frozenset[str] = frozenset()
    stretch: MapStretch | None = None
    only: frozenset[str] | None = None
    _own: Shared = field(default_factory=Shared, repr=False)

    @property
    def manifest(self) -> Manifest:
        """The bundle's manifest."""
        return self.bundle.manifest

    def table(self, name: str) -> Table:
        """A table by name; of references only those the robot itself sensed."""
        self._check_may_read(name)
        if name in self.tables:
            return self.tables[name]
        if name in ("references", RELATIONS):
            return self.recorded(name)
        return self.bundle.evidence(name)

    def recorded(self, name: str) -> Table:
        """A table by name with its placeholders, for whoever asks what they are."""
        self._check_may_read(name)
        if name in self.tables:
            return self.tables[name]
        if name == RELATIONS:
            return Table.empty(TABLES[name])
        table = self.bundle.table(name)
        if name == "references":
            return table.take(
                ~np.isin(table["kind"].astype(str), sorted(JUDGING_KINDS | self.held_out))
            )
        return table

    def _check_may_read(self, name: str) -> None:
        if self.only is not None and name not in self.only:
            raise AssertionError(f"what is made of {sorted(self.only)} alone reads {name}")

    def shared(
        self,
        kind: str,
        tables: Collection[str],
        make: Callable[[BundleView], T],
        *,
        by: Hashable = (),
    ) -> T:
        """What `make` works out of some tables, once for all views that have these as recorded.

        It is given a view with those tables alone, without a map of its own and without settings,
        so that what it gives is the same bits whoever asked first. Nobody may change it.

        Args:
            kind: of the result.
            tables: names of all that is read; not references, of which views differ in silence.
            make: does the work.
            by: what the result depends on beside the tables.
        """
        if {"references", RELATIONS} & set(tables):
            raise AssertionError("references are not shared between views")
        names = sorted(tables)
        found = [self.table(name) for name in names]
        place = self._own if any(name in self.tables for name in names) else self.bundle.shared
        alone = replace(
            self, only=frozenset(names), replaced_grid=None, settings=MappingProxyType({})
        )
        return place.of(kind, by, found, lambda: make(alone))

    def role(self, role: str) -> Table | None:
        """The rows of the topic that plays `role` in its table, or None where none does."""
        topic = self.manifest.topic_of(role)
        if topic is None:
            return None
        table = self.table(ROLE_TABLES[role])
        mine = table["topic"] == topic
        return table if len(table) and bool(np.all(mine)) else table.take(mine)

    @property
    def span(self) -> tuple[int, int]:
        """First and last moment that is looked at, ns."""
        if self.stretch is not None:
            return self.stretch.start_ns, self.stretch.end_ns
        return self.manifest.start_ns, self.manifest.end_ns

    @cached_property
    def map_course(self) -> tuple[Held, ...]:
        """The map versions that held, from the first to the last moment of the span."""
        if self.replaced_grid is not None:
            return (Held(self.replaced_grid.version, *self.span),)
        if self.stretch is not None:
            return self.stretch.held
        held = map_course(self.table("map_updates"), self.bundle.map_versions, *self.span)
        return renamed(held, {h.version: self._stands_for(h.version) for h in held})

    @cached_property
    def map_stretches(self) -> tuple[MapStretch, ...]:
        """The parts of the log over which the maps were of one place; none without a map."""
        if self.stretch is not None:
            return (MapStretch(self.map_course),)
        if self.redrawn:
            return map_stretches(self.map_course, self.grid_of)
        return self.bundle.map_stretches(self.map_course)

    @cached_property
    def grid(self) -> OccupancyGrid | None:
        """The map: the version at the end, in which places and changes are told."""
        stretches = self.map_stretches
        return self.grid_of(stretches[-1].version) if stretches else None

    def grid_of(self, version: str) -> OccupancyGrid | None:
        """A map by its version, None where it is not there."""
        for grid in (self.replaced_grid, *self.redrawn.values()):
            if grid is not None and grid.version == version:
                return grid
        return self.bundle.grid(version)

    def within(self, stretch: MapStretch) -> BundleView:
        """A view of one stretch: its scans and sightings only; the rest is looked up by time."""
        is_first = stretch.start_ns <= self.manifest.start_ns
        is_last = stretch.end_ns >= self.manifest.end_ns
        tables = {}
        for name in ("scans", "references"):
            t_ns = self.table(name).t_ns
            own = (is_first | (t_ns >= stretch.start_ns)) & (is_last | (t_ns < stretch.end_ns))
            tables[name] = self.table(name).take(own)
        return replace(self, tables={**self.tables, **tables}, stretch=stretch)

    def _stands_for(self, recorded: str) -> str:
        """The version that holds whenever a version of the bundle did."""
        return self.redrawn[recorded].version if recorded in self.redrawn else recorded

    @cached_property
    def transforms(self) -> TransformBuffer:
        """The tf tree of this view."""
        return self.shared(
            "tf tree",
            ["transforms"],
            lambda view: TransformBuffer(edges_of(view.table("transforms"))),
        )

    def with_table(self, table: Table) -> BundleView:
        """A view with one table exchanged."""
        return replace(self, tables={**self.tables, table.schema.name: table})

    def with_grid(self, grid: OccupancyGrid) -> BundleView:
        """A view in which one map holds all along."""
        return replace(self, replaced_grid=grid)

    def with_grids(self, grids: Mapping[str, OccupancyGrid]) -> BundleView:
        """A view with other maps in place of some that hold at some time, by their versions."""
        if self.replaced_grid is not None:
            return self.with_grid(grids.get(self.replaced_grid.version, self.replaced_grid))
        redrawn = dict(self.redrawn)
        for recorded in self.bundle.map_versions:
            if self._stands_for(recorded) in grids:
                redrawn[recorded] = grids[self._stands_for(recorded)]
        new = {version: grid.version for version, grid in grids.items()}
        stretch = None if self.stretch is None else MapStretch(renamed(self.stretch.held, new))
        return replace(self, redrawn=redrawn, stretch=stretch)

    def with_setting(self, name: str, value: float) -> BundleView:
        """A view that asks estimators to run with one setting changed."""
        return replace(self, settings={**self.settings, name: value})


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
