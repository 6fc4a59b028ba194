"""FORMAT.md, printed from the schema, so that the page and the files cannot disagree."""

from __future__ import annotations

from slamreplay.bundle.schema import FORMAT_VERSION, TABLES, Column, TableSchema

_HEAD = """# The replay bundle, format version {version}

A bundle is a folder that is written once and never changed:

- `manifest.json`: format version, id, sources with their hashes, the role each topic plays and why,
  the clock, the frames, what is missing, every loss with its count, and a hash of each table.
- `tables/*.parquet` (zstd): the tables below; every bundle has all of them, empty ones too.
- `maps/<version>/`: `map.yaml` and `map.pgm` as map_server reads them, `cells.npy` with the exact
  cells, and the map's frame in the yaml. The version is the hash of content and metadata.

Times are int64 nanoseconds. `t_ns` is on the bundle's clock, `t_sensor_ns` is the header stamp as
it was recorded (null where there is none), `t_log_ns` is when the recorder wrote the message. Rows
are sorted by `t_ns`. Vectors and matrices are fixed-size lists, ragged ones are lists. Unit, frame
and meaning of each column stand in the Parquet files' own metadata too. The id is the hash of the
manifest, which holds the hashes of everything else: the same log gives the same bytes.

Placeholders stay as they were recorded: covariances that are all zero, constant although the robot
moved, 1e6 or 1e-9, or odometry's that never grow; rates and velocities that are the same
throughout. They are judged over a whole topic, and estimators, hindsight, checks and the verdict,
which read a view of the bundle, find NaN in their stead: not given. Only where a message type has
a mark of its own for that (an Imu's covariance that starts with -1, an unknown covariance of a
satellite fix) the table holds NaN already.
"""


def format_page() -> str:
    """The text of FORMAT.md."""
    parts = [_HEAD.format(version=FORMAT_VERSION)]
    parts += [_section(schema) for schema in TABLES.values()]
    return "\n".join(parts)


def _section(schema: TableSchema) -> str:
    lines = [f"## {schema.name}", "", f"{schema.doc[0].upper()}{schema.doc[1:]}.", ""]
    lines += ["| column | type | unit | frame | meaning |", "|---|---|---|---|---|"]
    lines += [_line(column) for column in schema.columns]
    return "\n".join(lines) + "\n"


def _line(column: Column) -> str:
    kind = {"list_f32": "list of float32", "list_f64": "list of float64", "list_i8": "list of int8",
            "str": "string"}.get(column.kind, column.kind)  # fmt: skip
    kind = f"{kind}[{column.size}]" if column.size else kind
    return f"| `{column.name}` | {kind} | {column.unit} | {column.frame} | {column.doc} |"
