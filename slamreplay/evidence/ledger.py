"""ledger.parquet: every measurement of every run, and what it did to the belief."""

from __future__ import annotations

import io
import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from slamreplay.bundle.run import Innovations, Run, Trial
from slamreplay.consistency.belief.jumps.steps import sizes_of
from slamreplay.evidence.clean import clean

LEDGER_FILE = "ledger.parquet"


@dataclass(frozen=True, eq=False)
class LedgerSet:
    """One source of one run's ledger."""

    trial: Trial
    set: Innovations

    def __len__(self) -> int:
        return len(self.set.t_ns)

    @property
    def mean_nis(self) -> float | None:
        """Of what the update used; None where S is no prediction, or nothing is known."""
        if not self.set.is_predicted:
            return None
        nis = self.set.nis[self.set.accepted]
        nis = nis[np.isfinite(nis)]
        return float(nis.mean()) if len(nis) else None

    @property
    def largest(self) -> int | None:
        """The row that moved the belief most, None where none is known to have."""
        size = sizes_of(self.set.moved)
        return int(np.nanargmax(size)) if np.isfinite(size).any() else None


def ledger_sets(runs: Sequence[Run]) -> tuple[LedgerSet, ...]:
    """The sources of all runs that have a ledger, in their order."""
    return tuple(
        LedgerSet(run.trial, one)
        for run in runs
        if run.estimate is not None
        for one in run.estimate.innovations
        if len(one.t_ns)
    )


def run_name(trial: Trial) -> str:
    """A run in words: "amcl, tf_delay.all 0.2 s"."""
    if trial.perturbation is None:
        return trial.estimator
    level = "" if trial.level is None else f" {trial.level:g} {trial.unit}".rstrip()
    return f"{trial.estimator}, {trial.perturbation}{level}"


def ledger_bytes(sets: Sequence[LedgerSet], *, clock: str) -> bytes:
    """A Parquet table with one row per measurement, runs in order; the same bytes of the same ones.

    Columns: `estimator`, `perturbation` and `level` with `unit` (null for the baseline), `seed`;
    `source`, `frame_id`, `t_ns`, `about`, `accepted`, `score`; `residual` and `S` (row-major) in
    `axes`, whose names hold the units; `nis`; `moved_x_m`, `moved_y_m`, `moved_yaw_rad`, the belief
    after minus before in its own frame; `is_predicted`, whether S is what the estimator predicted.
    What is not known is null.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    schema = pa.schema([
        ("estimator", pa.string()), ("perturbation", pa.string()), ("level", pa.float64()),
        ("unit", pa.string()), ("seed", pa.int64()), ("source", pa.string()),
        ("frame_id", pa.string()), ("t_ns", pa.int64()), ("about", pa.string()),
        ("accepted", pa.bool_()), ("score", pa.float64()), ("nis", pa.float64()),
        ("moved_x_m", pa.float64()), ("moved_y_m", pa.float64()), ("moved_yaw_rad", pa.float64()),
        ("is_predicted", pa.bool_()), ("axes", pa.list_(pa.string())),
        ("residual", pa.list_(pa.float64())), ("S", pa.list_(pa.float64())),
    ], metadata={"slamreplay": json.dumps({"clock": clock})})  # fmt: skip
    tables = [pa.table(_columns(one), schema=schema) for one in sets]
    table = pa.concat_tables(tables) if tables else schema.empty_table()
    sink = io.BytesIO()
    pq.write_table(table.combine_chunks(), sink, compression="zstd")
    return sink.getvalue()


def _columns(one: LedgerSet) -> dict[str, Any]:
    import pyarrow as pa

    n, trial, seen = len(one), one.trial, one.set
    m = np.asarray(seen.residual).shape[1]

    def number(values: Any) -> Any:
        return pa.array(np.asarray(values, dtype=np.float64), from_pandas=True)

    def rows(values: Any, size: int) -> Any:
        flat = number(np.asarray(values, dtype=np.float64).reshape(-1))
        return pa.ListArray.from_arrays(np.arange(n + 1, dtype=np.int32) * size, flat)

    return {
        "estimator": [trial.estimator] * n,
        "perturbation": [trial.perturbation] * n,
        "level": pa.array([trial.level] * n, pa.float64()),
        "unit": [trial.unit] * n,
        "seed": [trial.seed] * n,
        "source": [clean(seen.source)] * n,
        "frame_id": [clean(seen.frame_id)] * n,
        "t_ns": seen.t_ns,
        "about": [clean(text) for text in seen.about.tolist()],
        "accepted": np.asarray(seen.accepted, dtype=bool),
        "score": number(seen.score),
        "nis": number(seen.nis),
        **{name: number(seen.moved[:, k]) for k, name in enumerate(_MOVED)},
        "is_predicted": [seen.is_predicted] * n,
        "axes": [list(seen.axes)] * n,
        "residual": rows(seen.residual, m),
        "S": rows(seen.S, m * m),
    }


_MOVED = ("moved_x_m", "moved_y_m", "moved_yaw_rad")
