"""The counts as tables, sentences and a picture."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure

from slamreplay.consistency.answers import P_ACCUSE
from slamreplay.consistency.statistics.mean_test import N_EFF_MIN, NOMINAL
from slamreplay.labs.interval_calibration.trials import Cell
from slamreplay.labs.intervals import share_interval
from slamreplay.labs.lab import LabResults, ResultTable
from slamreplay.report.figures.calibration import Curve, calibration_figure

#: What the false alarms of a nominal 5 % interval have to stay within.
LEAST, MOST = 0.02, 0.08

_FALSE = (
    "dof",
    "n_eff",
    "rho",
    "rows",
    "outside of 95 % [%]",
    "95 % interval [%]",
    f"p < {P_ACCUSE:g} [%]",
    "insufficient [%]",
    "textbook [%]",
    "n_eff estimated",
)
_FOUND = ("n_eff", "sigma too small by", "outside of 95 % [%]", f"p < {P_ACCUSE:g} [%]",
          "insufficient [%]")  # fmt: skip


def results(false: Sequence[Cell], found: Sequence[Cell], harder: Sequence[Cell]) -> LabResults:
    """What all cells say together."""
    tables = [
        ResultTable("False alarms on consistent AR(1) errors", _FALSE, [_false(c) for c in false],
                    brief=(*_FALSE[:3], _FALSE[4], _FALSE[7], _FALSE[8])),
        ResultTable(
            f"Sigma told too small, {found[0].dof} degrees of freedom, rho {found[0].rho:g}",
            _FOUND,
            [_found(c) for c in found],
        ),
    ]  # fmt: skip
    if harder:
        head = ("memory", *_FALSE[3:])
        rows = [(c.memory, *_false(c)[3:]) for c in harder]
        title = "False alarms on consistent errors of harder memories"
        tables.append(ResultTable(title, head, rows, brief=(head[0], head[1], head[2], head[6])))
    numbers = {
        "nominal": NOMINAL,
        "false_alarms": [c.numbers() for c in false],
        "found": [c.numbers() for c in found],
        "harder_memories": [c.numbers() for c in harder],
    }
    return LabResults(
        numbers=numbers,
        tables=tables,
        notes=_notes(false),
        figures={"calibration": lambda: _figure(false, found)},
    )


def _false(cell: Cell) -> tuple[str, ...]:
    low, high = share_interval(cell.missed, cell.logs)
    return (
        f"{cell.dof}",
        f"{cell.n_eff}",
        f"{cell.rho}",
        f"{cell.rows}",
        _percent(cell.missed / cell.logs),
        f"{_percent(low)} to {_percent(high)}",
        _percent(cell.accused / cell.logs),
        _percent(cell.undecided / cell.logs),
        _percent(cell.naive / cell.logs),
        f"{cell.estimated:.0f}",
    )


def _found(cell: Cell) -> tuple[str, ...]:
    return (
        f"{cell.n_eff}",
        f"{cell.ratio:g}",
        _percent(cell.missed / cell.logs),
        _percent(cell.accused / cell.logs),
        _percent(cell.undecided / cell.logs),
    )


def _percent(share: float) -> str:
    return f"{100.0 * share:.1f}"


def _notes(false: Sequence[Cell]) -> list[str]:
    shares = [c.missed / c.logs for c in false if c.n_eff is not None and c.n_eff >= N_EFF_MIN]
    text = (
        f"At {N_EFF_MIN} effective samples and more the nominal 5 % intervals cry wolf in "
        f"{_percent(min(shares))} to {_percent(max(shares))} % of consistent logs; they are to "
        f"stay between {_percent(LEAST)} and {_percent(MOST)} %."
        if shares
        else f"No cell has {N_EFF_MIN} effective samples."
    )
    return [
        text,
        (
            "insufficient: even the upper end of the 99 % interval of the estimated n_eff is below "
            f"{N_EFF_MIN}; nothing is decided then, which counts as neither false alarm nor found. "
            "Where n_eff is given it is the true one: rows (1 - rho2) / (1 + rho2)."
        ),
        "textbook: the chi-square interval that counts every row as an independent one.",
    ]


def _figure(false: Sequence[Cell], found: Sequence[Cell]) -> Figure:
    dof = found[0].dof if any(c.dof == found[0].dof for c in false) else false[0].dof
    alarms = []
    for n in dict.fromkeys(c.n_eff for c in false):
        cells = [c for c in false if c.n_eff == n and c.dof == dof]
        bounds = [share_interval(c.missed, c.logs) for c in cells]
        alarms.append(
            Curve(
                f"{n} effective samples",
                [float(c.rho or 0.0) for c in cells],
                [c.missed / c.logs for c in cells],
                [c.naive / c.logs for c in cells],
                [low for low, _ in bounds],
                [high for _, high in bounds],
            )
        )
    powers = []
    for n in dict.fromkeys(c.n_eff for c in found):
        cells = [c for c in found if c.n_eff == n]
        powers.append(
            Curve(
                f"{n} effective samples",
                [c.ratio for c in cells],
                [c.missed / c.logs for c in cells],
                [c.accused / c.logs for c in cells],
            )
        )
    return calibration_figure(alarms, powers, (LEAST, MOST), NOMINAL, P_ACCUSE, dof)
