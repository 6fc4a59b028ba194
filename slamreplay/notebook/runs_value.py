"""Estimators run on one log, undisturbed and with one thing changed at a time."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from slamreplay.errors import UsageError
from slamreplay.notebook.log_bundle import LogBundle

if TYPE_CHECKING:
    import pandas as pd

    from slamreplay.bundle.run import Run
    from slamreplay.replay.dose import DoseResults

#: Columns that a cell shows; `table` has them all.
_SHOWN = (
    "baseline_max_m",
    "reference_rmse_m",
    "ate_aligned_m",
    "nees_mean",
    "nees_low",
    "nees_high",
)


@dataclass(frozen=True, eq=False, repr=False)
class Runs:
    """Runs on one log, the baselines first.

    Attributes:
        log: what they are of.
        runs: one a trial.
        design: the answer of a recipe that laid them out; None without one.
    """

    log: LogBundle
    runs: tuple[Run, ...]
    design: DoseResults | None = None

    def __len__(self) -> int:
        return len(self.runs)

    @cached_property
    def table(self) -> pd.DataFrame:
        """A row a run: what was changed, and what it was worth; NaN for what cannot be said."""
        import pandas as pd

        from slamreplay.notebook.frames import with_units
        from slamreplay.report.metrics import metrics_of_runs

        rows = []
        for run, metrics in zip(
            self.runs, metrics_of_runs(self.log.bundle, self.runs), strict=True
        ):
            trial = run.trial
            head = {"estimator": trial.estimator, "perturbation": trial.perturbation,
                    "level": trial.level, "unit": trial.unit, "seed": trial.seed,
                    "not_applicable": run.not_applicable}  # fmt: skip
            rows.append({**head, **metrics})
        texts = ("estimator", "perturbation", "unit", "not_applicable")  # None stays None
        kinds = {name: "object" if name in texts else "float64" for row in rows for name in row}
        frame = pd.DataFrame(rows, columns=list(kinds), dtype="object")
        return with_units(frame.astype({**kinds, "seed": "int64"}))

    def trajectory(self, i: int) -> pd.DataFrame:
        """Poses and covariances of run `i`, by its place in the table.

        Raises:
            UsageError: there is no such run, or the log or the estimator did not allow it.
        """
        from slamreplay.notebook.frames import track_frame

        if not -len(self.runs) <= i < len(self.runs):
            raise UsageError(f"there is no run {i}", hint=f"there are 0 to {len(self.runs) - 1}")
        run = self.runs[i]
        if run.estimate is None:
            raise UsageError(f"run {i} is not applicable: {run.not_applicable}")
        return track_frame(run.estimate.track, self.log.manifest.start_ns)

    def save(self, folder: str | Path) -> Path:
        """Write them as `slamreplay perturb -o` does, the bundle with them.

        Raises:
            OutputError: somebody else's folder, or one that cannot be written.
            UsageError: the answer of a recipe, which `sr.perturb` writes where it is made.
        """
        from slamreplay.replay.folder import write_runs

        if self.design is not None:
            raise UsageError(
                "runs of a recipe are written when made", hint="give perturb an output"
            )
        write_runs(Path(folder), self.log.bundle, self.runs, keep_bundle=True)
        return Path(folder)

    def __repr__(self) -> str:
        names = dict.fromkeys(run.trial.estimator for run in self.runs)
        return f"<Runs of {self.log.name}: {len(self)} by {', '.join(names)}>"

    def _repr_html_(self) -> str:
        from slamreplay.notebook import markup

        frame = self.table
        numbers = [name for name in _SHOWN if name in frame and frame[name].notna().any()]
        rows = [
            (
                row["estimator"],
                row["perturbation"] or "(baseline)",
                "" if row["perturbation"] is None else f"{row['level']:g} {row['unit']}",
                *("" if row[n] != row[n] else f"{row[n]:.3f}" for n in numbers),
                row["not_applicable"] or "",
            )
            for _, row in frame.iterrows()
        ]
        head = ("estimator", "perturbation", "level", *numbers, "not applicable")
        few = head if any(row[-1] for row in rows) else head[:-1]
        return markup.box(
            markup.heading(f"{len(self)} runs", self.log.name),
            markup.grid(few, [row[: len(few)] for row in rows]),
        )
