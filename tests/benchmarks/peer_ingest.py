"""What somebody without slamreplay would write: rosbags' AnyReader, columns, Parquet.

Usage: python peer_ingest.py LOG FOLDER
"""

import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

sys.path.insert(0, str(Path(__file__).parent))
from test_reading import PICK, with_rosbags


def arrow(column):
    if column.dtype == object or column.dtype.kind == "U":
        return pa.array(column.tolist(), type=pa.string())
    if column.ndim == 1:
        return pa.array(column)
    return pa.FixedSizeListArray.from_arrays(pa.array(column.ravel()), column.shape[1])


def main(log: Path, folder: Path) -> None:
    folder.mkdir(parents=True)
    columns, times = with_rosbags(log)
    for number, ((topic, kind), found) in enumerate(sorted(columns.items())):
        arrays = [arrow(c) for c in found[:-1] or found]
        if PICK[kind][2]:  # the last column is ragged: all rows in this log have one length
            rows, values = len(times[topic]), found[-1].ravel()
            offsets = np.arange(rows + 1, dtype=np.int32) * (len(values) // rows)
            arrays.append(pa.ListArray.from_arrays(pa.array(offsets), pa.array(values)))
        else:
            arrays.append(arrow(found[-1]))
        names = [f"c{k}" for k in range(len(arrays))]
        if len(arrays[0]) == len(times[topic]):
            arrays.append(pa.array(times[topic]))
            names.append("t_log_ns")
        table = pa.table(dict(zip(names, arrays, strict=True)))
        text = [n for n, a in zip(names, arrays, strict=True) if pa.types.is_string(a.type)]
        pq.write_table(table, folder / f"{number}.parquet", compression="zstd", use_dictionary=text)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
