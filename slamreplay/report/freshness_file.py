"""freshness.parquet: which part of the map was seen, and how it fared."""

from __future__ import annotations

import io
import json

import numpy as np

from slamreplay.bundle.freshness import NEVER, Freshness
from slamreplay.geometry import se2

FRESHNESS_FILE = "freshness.parquet"


def freshness_bytes(freshness: Freshness, *, frame: str, clock: str) -> bytes:
    """A Parquet table with one row per cell that was seen; the same layer gives the same bytes.

    Columns: `row` and `col` of the lattice, `x_m` and `y_m` of the cell's centre in the map frame,
    `confirmed_ns` and `contradicted_ns`, null for never. The lattice's resolution, origin and shape
    and the clock stand in the schema's metadata under `slamreplay`, as JSON.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    confirmed, contradicted = freshness.confirmed_ns, freshness.contradicted_ns
    row, col = np.nonzero((confirmed != NEVER) | (contradicted != NEVER))
    local = (np.column_stack([col, row]) + 0.5) * freshness.resolution_m
    xy = se2.transform_points(freshness.origin_xyyaw, local)
    columns = {
        "row": pa.array(row.astype(np.int32)),
        "col": pa.array(col.astype(np.int32)),
        "x_m": pa.array(xy[:, 0]),
        "y_m": pa.array(xy[:, 1]),
        **{
            name: pa.array(times[row, col], mask=times[row, col] == NEVER)
            for name, times in (("confirmed_ns", confirmed), ("contradicted_ns", contradicted))
        },
    }
    meta = {
        "resolution_m": freshness.resolution_m,
        "origin_xyyaw": freshness.origin_xyyaw.tolist(),
        "shape": list(confirmed.shape),
        "frame": frame,
        "clock": clock,
        "end_ns": freshness.end_ns,
    }
    table = pa.table(columns).replace_schema_metadata({"slamreplay": json.dumps(meta)})
    sink = io.BytesIO()
    pq.write_table(table, sink, compression="zstd", use_dictionary=False)
    return sink.getvalue()
