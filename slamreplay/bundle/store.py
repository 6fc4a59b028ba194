"""Bundles on disk: `manifest.json`, `tables/*.parquet`, `maps/<version>/map.{yaml,pgm}`."""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import yaml
from pydantic import ValidationError

from slamreplay.bundle.atomic import atomic_folder
from slamreplay.bundle.manifest import Manifest, MapVersion, TableEntry
from slamreplay.bundle.map_course import map_course
from slamreplay.bundle.schema import FORMAT_VERSION, TABLES
from slamreplay.bundle.tables import Table
from slamreplay.errors import BundleError
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.maps.map_server import map_files

MANIFEST = "manifest.json"


def parquet_bytes(table: Table) -> bytes:
    """The table as a Parquet file; the same rows give the same bytes."""
    sink = io.BytesIO()
    # Dictionary coding pays for text only, and costs more than compression on measured numbers.
    text = [c.name for c in table.schema.columns if c.kind == "str"]
    pq.write_table(table.to_arrow(), sink, compression="zstd", use_dictionary=text)
    return sink.getvalue()


def write_bundle(
    target: Path,
    manifest: Manifest,
    tables: Mapping[str, Table],
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
    whole = {name: tables.get(name, Table.empty(schema)) for name, schema in TABLES.items()}
    files = {f"tables/{name}.parquet": parquet_bytes(table) for name, table in whole.items()}
    entries = {
        name: TableEntry(
            rows=len(table),
            start_ns=int(table.t_ns.min()) if len(table) else None,
            end_ns=int(table.t_ns.max()) if len(table) else None,
            sha256=_sha256(files[f"tables/{name}.parquet"]),
        )
        for name, table in whole.items()
    }
    maps = []
    course = map_course(
        whole["map_updates"],
        [grid.version for grid in grids.values()],
        manifest.start_ns,
        manifest.end_ns,
    )
    for source, grid in grids.items():
        folder = grid.version.removeprefix("sha256:")[:16]
        files |= {f"maps/{folder}/{k}": v for k, v in _map_folder(grid).items()}
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
    identity = _sha256(manifest.model_dump_json().encode())
    manifest = manifest.model_copy(update={"bundle_id": identity[:16]})
    if _already_there(target, manifest):
        return manifest
    with atomic_folder(target, marker=MANIFEST) as work:
        for name, content in files.items():
            (work / name).parent.mkdir(parents=True, exist_ok=True)
            (work / name).write_bytes(content)
        text = json.dumps(manifest.model_dump(mode="json"), indent=1, allow_nan=False)
        (work / MANIFEST).write_text(text + "\n", encoding="utf-8")
    return manifest


def is_bundle(path: Path) -> bool:
    """Whether `path` is a folder with a bundle's manifest."""
    return (path / MANIFEST).is_file() and (path / "tables").is_dir()


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
    try:
        content = file.read_bytes()
    except OSError as error:
        raise BundleError("table is missing", where=file, hint="ingest the log again") from error
    if name not in manifest.tables or _sha256(content) != manifest.tables[name].sha256:
        raise BundleError(
            "bytes do not match the manifest's hash", where=file, hint="ingest the log again"
        )
    try:
        return Table.from_arrow(TABLES[name], pq.read_table(pa.BufferReader(content)))
    except pa.ArrowException as error:
        raise BundleError(f"not a readable Parquet file: {error}", where=file) from error


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
            read_table(target, manifest, name)
        for entry in manifest.maps:
            read_grid(target, entry)
    except BundleError:
        return False
    return True


def _sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()
