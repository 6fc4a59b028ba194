"""Bundles on disk: `manifest.json`, `tables/*.parquet`, `maps/<version>/map.{yaml,pgm}`."""

from __future__ import annotations

import hashlib
import io
import json
import shutil
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Protocol

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import yaml
from pydantic import ValidationError

from slamreplay.bundle.atomic import atomic_folder
from slamreplay.bundle.manifest import Manifest, MapVersion, TableEntry
from slamreplay.bundle.map_course import map_course
from slamreplay.bundle.schema import FORMAT_VERSION, TABLES, TableSchema
from slamreplay.bundle.tables import Table
from slamreplay.errors import BundleError
from slamreplay.geometry.times import Times
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.maps.map_server import map_files

MANIFEST = "manifest.json"


class Rows(Protocol):
    """A table, or one too large for memory that gives its rows part by part."""

    @property
    def t_ns(self) -> Times:
        """(N,) times on the bundle's clock."""
        ...

    def __len__(self) -> int: ...

    def groups(self) -> Iterator[Table]:
        """All rows in order, in parts that fit in memory."""
        ...


def write_parquet(rows: Rows, schema: TableSchema, path: Path) -> None:
    """A table as a Parquet file, a row group at a time; the same rows give the same bytes."""
    # Dictionary coding pays for text only, and costs more than compression on measured numbers.
    text = [c.name for c in schema.columns if c.kind == "str"]
    arrow = schema.arrow_schema
    with pq.ParquetWriter(path, arrow, compression="zstd", use_dictionary=text) as writer:
        for group in rows.groups():
            writer.write_table(group.to_arrow())
            pa.default_memory_pool().release_unused()  # else it keeps what the last group took


def write_bundle(
    target: Path,
    manifest: Manifest,
    tables: Mapping[str, Rows],
    grids: Mapping[str, OccupancyGrid],
) -> Manifest:
    """Write a bundle and return its manifest with table entries, maps and id filled in.

    Args:
        target: the bundle's folder; an equal bundle already there is kept as it is.
        manifest: everything but `tables`, `maps` and `bundle_id`, which are computed here.
        tables: by name; those without rows are written too, so that every bundle has all.
        grids: source description to map, the one that holds at the end last.

    Raises:
        OutputError: the folder is somebody else's or cannot be written.
    """
    with atomic_folder(target, marker=MANIFEST) as work:
        entries = {}
        (work / "tables").mkdir()
        for name, schema in TABLES.items():
            rows = tables.get(name, Table.empty(schema))
            file = work / "tables" / f"{name}.parquet"
            write_parquet(rows, schema, file)
            entries[name] = TableEntry(
                rows=len(rows),
                start_ns=int(rows.t_ns.min()) if len(rows) else None,
                end_ns=int(rows.t_ns.max()) if len(rows) else None,
                sha256=_sha256(file),
            )
        maps = []
        updates = tables["map_updates"].groups() if "map_updates" in tables else ()
        course = map_course(
            Table.concat(TABLES["map_updates"], updates),
            [grid.version for grid in grids.values()],
            manifest.start_ns,
            manifest.end_ns,
        )
        for source, grid in grids.items():
            folder = grid.version.removeprefix("sha256:")[:16]
            (work / "maps" / folder).mkdir(parents=True, exist_ok=True)
            for name, content in _map_folder(grid).items():
                (work / "maps" / folder / name).write_bytes(content)
            height, width = grid.cells.shape
            maps.append(
                MapVersion(
                    version=grid.version,
                    folder=folder,
                    source=source,
                    width=width,
                    height=height,
                    resolution_m=grid.resolution_m,
                    held_ns=[(h.start_ns, h.end_ns) for h in course if h.version == grid.version],
                )
            )
        manifest = manifest.model_copy(update={"tables": entries, "maps": maps, "bundle_id": ""})
        identity = hashlib.sha256(manifest.model_dump_json().encode()).hexdigest()
        manifest = manifest.model_copy(update={"bundle_id": identity[:16]})
        text = json.dumps(manifest.model_dump(mode="json"), indent=1, allow_nan=False)
        (work / MANIFEST).write_text(text + "\n", encoding="utf-8")
        if _already_there(target, manifest):
            shutil.rmtree(work)
    return manifest


def is_bundle(path: Path) -> bool:
    """Whether `path` is a folder with a bundle's manifest."""
    try:
        return (path / MANIFEST).is_file() and (path / "tables").is_dir()
    except OSError:  # a name that no folder can have
        return False


def read_manifest(path: Path) -> Manifest:
    """The manifest of the bundle at `path`.

    Raises:
        BundleError: no bundle, another format version, or a manifest that is damaged.
    """
    try:
        raw = json.loads((path / MANIFEST).read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise BundleError("not a bundle", where=path, hint="make one with ingest") from error
    version = raw.get("format_version") if isinstance(raw, dict) else None
    if version != FORMAT_VERSION:
        raise BundleError(
            f"bundle format {version}, this program reads {FORMAT_VERSION}",
            where=path,
            hint="ingest the log again",
        )
    try:
        return Manifest.model_validate(raw)
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(str(part) for part in first["loc"])
        raise BundleError(f"manifest: {key}: {first['msg']}", where=path) from error


def read_table(path: Path, manifest: Manifest, name: str) -> Table:
    """One table of the bundle at `path`, its bytes checked against the manifest's hash.

    Raises:
        BundleError: missing, changed since it was written, or unreadable.
    """
    file = path / "tables" / f"{name}.parquet"
    _check(file, manifest, name)
    try:
        table = Table.from_arrow(TABLES[name], _arrow(file))
    except pa.ArrowException as error:
        raise BundleError(f"not a readable Parquet file: {error}", where=file) from error
    pa.default_memory_pool().release_unused()  # it keeps twice what a large table takes
    return table


def read_columns(path: Path, manifest: Manifest, name: str, columns: Sequence[str]) -> pa.Table:
    """Some columns of a table as Arrow has them, the file checked as by `read_table`.

    Raises:
        BundleError: missing, changed since it was written, or unreadable.
    """
    file = path / "tables" / f"{name}.parquet"
    _check(file, manifest, name)
    try:
        return _arrow(file, list(columns))
    except pa.ArrowException as error:
        raise BundleError(f"not a readable Parquet file: {error}", where=file) from error


def _arrow(file: Path, columns: list[str] | None = None) -> pa.Table:
    """The table in one file; `parquet.read_table`, made for many, would load pandas first."""
    with pq.ParquetFile(file, memory_map=False) as stored:
        return stored.read(columns)


def read_grid(path: Path, entry: MapVersion) -> OccupancyGrid:
    """One map of the bundle at `path`, checked against its version.

    Raises:
        BundleError: missing, or its content does not hash to its version.
    """
    folder = path / "maps" / entry.folder
    try:
        meta = yaml.safe_load((folder / "map.yaml").read_text(encoding="utf-8"))
        cells = np.load(folder / "cells.npy", allow_pickle=False)
        origin = np.array(meta["origin"], dtype=np.float64)
        grid = OccupancyGrid(cells, float(meta["resolution"]), origin, str(meta["frame_id"]))
    except (OSError, ValueError, KeyError, TypeError, yaml.YAMLError) as error:
        raise BundleError("map cannot be read", where=folder) from error
    if grid.version != entry.version:
        raise BundleError("map does not match its version", where=folder)
    return grid


def _map_folder(grid: OccupancyGrid) -> dict[str, bytes]:
    """map_server files for people and other tools, and the exact cells for us.

    The image is trinary, while an occupancy grid may hold probabilities in between.
    """
    files = map_files(grid, "map")
    meta = yaml.safe_load(files["map.yaml"])
    files["map.yaml"] = yaml.safe_dump(
        {**meta, "frame_id": grid.frame_id}, sort_keys=False, default_flow_style=None
    ).encode()
    sink = io.BytesIO()
    np.save(sink, grid.cells, allow_pickle=False)
    return {**files, "cells.npy": sink.getvalue()}


def _already_there(target: Path, manifest: Manifest) -> bool:
    if not is_bundle(target):
        return False
    try:
        if read_manifest(target) != manifest:
            return False
        for name in manifest.tables:
            _check(target / "tables" / f"{name}.parquet", manifest, name)
        for entry in manifest.maps:
            read_grid(target, entry)
    except BundleError:
        return False
    return True


def _check(file: Path, manifest: Manifest, name: str) -> None:
    try:
        digest = _sha256(file)
    except OSError as error:
        raise BundleError("table is missing", where=file, hint="ingest the log again") from error
    if name not in manifest.tables or digest != manifest.tables[name].sha256:
        raise BundleError(
            "bytes do not match the manifest's hash", where=file, hint="ingest the log again"
        )


def _sha256(file: Path) -> str:
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
