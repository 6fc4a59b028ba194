"""A log as tables: what `sr.ingest` gives."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from slamreplay.errors import UsageError

if TYPE_CHECKING:
    import pandas as pd

    from slamreplay.bundle.manifest import Manifest
    from slamreplay.bundle.view import Bundle
    from slamreplay.maps.grid import OccupancyGrid


class NoTableError(UsageError, KeyError):
    """A table that no bundle has."""


class Tables(Mapping[str, "pd.DataFrame"]):
    """The tables of a log by name, read when they are asked for; those with rows are listed."""

    def __init__(self, bundle: Bundle) -> None:
        self._bundle = bundle

    def __getitem__(self, name: str) -> pd.DataFrame:
        """As it was recorded, placeholders and references that only judge included.

        Raises:
            NoTableError: there is no table of that name.
        """
        from slamreplay.bundle.schema import TABLES
        from slamreplay.notebook.frames import table_frame
        from slamreplay.registry import nearest

        if name not in TABLES:
            raise NoTableError(f"there is no table '{name}'", hint=nearest(str(name), TABLES))
        return table_frame(self._bundle.table(name), self._bundle.manifest.start_ns)

    def __iter__(self) -> Iterator[str]:
        return iter(name for name, rows in self.rows.items() if rows)

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def _ipython_key_completions_(self) -> list[str]:
        return list(self)

    @property
    def rows(self) -> dict[str, int]:
        """How many rows each table has."""
        return {name: entry.rows for name, entry in self._bundle.manifest.tables.items()}

    def __repr__(self) -> str:
        return f"Tables({', '.join(f'{name}: {self.rows[name]}' for name in self)})"

    def _repr_html_(self) -> str:
        from slamreplay.notebook import markup

        return markup.box(markup.grid(("table", "rows"), [(n, self.rows[n]) for n in self]))


@dataclass(frozen=True, eq=False, repr=False)
class LogBundle:
    """A log, ingested: immutable, and the same whatever is asked of it.

    Attributes:
        bundle: what the rest of the package works on.
        keeps: what must live as long as this does, as the folder of a bundle that nobody named.
    """

    bundle: Bundle
    keeps: object = field(default=None, repr=False)

    @property
    def path(self) -> Path | None:
        """The bundle's folder; in the cache, where none was named."""
        return self.bundle.path

    @property
    def manifest(self) -> Manifest:
        """What it says about itself: sources, roles with reasons, clock, frames, losses."""
        return self.bundle.manifest

    @property
    def tables(self) -> Tables:
        """Its tables as DataFrames."""
        return Tables(self.bundle)

    @cached_property
    def missing(self) -> pd.DataFrame:
        """Which of the eight parts it lacks, why, and what cannot be judged without them."""
        import pandas as pd

        rows = [(m.part, m.reason, m.consequence) for m in self.manifest.missing]
        return pd.DataFrame(rows, columns=["part", "reason", "consequence"])

    @cached_property
    def roles(self) -> pd.DataFrame:
        """Which topic plays which role, and why it was chosen."""
        import pandas as pd

        rows = [(r.role, r.topic, r.type, r.messages, r.reason) for r in self.manifest.roles]
        return pd.DataFrame(rows, columns=["role", "topic", "type", "messages", "reason"])

    @property
    def maps(self) -> dict[str, OccupancyGrid]:
        """Its maps by version, the newest last; `cells` (H, W): 0 free to 100 occupied, -1."""
        return self.bundle.grids()

    @property
    def duration_s(self) -> float:
        """How long the log is, s."""
        return (self.manifest.end_ns - self.manifest.start_ns) / 1e9

    @property
    def name(self) -> str:
        """Names of the files it was made of."""
        return " + ".join(s.name for s in self.manifest.sources) or self.manifest.bundle_id

    def __repr__(self) -> str:
        missing = ", ".join(self.manifest.missing_parts()) or "nothing"
        tables = self.tables
        rows = f"{len(tables)} tables" if len(tables) != 1 else "1 table"
        return f"<LogBundle {self.name}: {self.duration_s:.1f} s, {rows}, missing: {missing}>"

    def _repr_html_(self) -> str:
        from slamreplay.bundle.role_tables import ROLE_TABLES
        from slamreplay.notebook import markup

        topics: dict[str, list[str]] = {}
        for role in self.manifest.roles:
            topics.setdefault(ROLE_TABLES.get(role.role, ""), []).append(role.topic)
        tables = [
            (name, f"{rows:,}", ", ".join(dict.fromkeys(topics.get(name, []))))
            for name, rows in self.tables.rows.items()
            if rows
        ]
        missing = [(m.part, m.consequence) for m in self.manifest.missing]
        maps = [
            (m.source, f"{m.width} x {m.height} cells of {m.resolution_m:g} m")
            for m in self.manifest.maps
        ]
        return markup.box(
            markup.heading(self.name, f"{self.duration_s:.1f} s on the {self._clock} clock"),
            markup.grid(("table", "rows", "topics that play a role"), tables),
            markup.grid(("map", "size"), maps) if maps else markup.paragraph("No map."),
            markup.grid(("missing", "what cannot be judged without it"), missing)
            if missing
            else markup.paragraph("All eight parts are there."),
        )

    @property
    def _clock(self) -> str:
        return self.manifest.clock.name
