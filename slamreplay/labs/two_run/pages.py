"""The answer as tables, sentences and a picture."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.figure import Figure

from slamreplay.labs.digits import four_digits
from slamreplay.labs.intervals import median_interval, share_interval
from slamreplay.labs.lab import LabResults, ResultTable
from slamreplay.labs.two_run.rules import Rules
from slamreplay.labs.two_run.trials import Course
from slamreplay.report.figures.two_run import Strip, Way, two_run_figure
from slamreplay.simulate.alike import twin_bays

_HEAD = (
    "run",
    "credible from [s]",
    "never credible",
    "wrong for [s]",
    "longest wrong until [s]",
    "logs collapsed",
    "longest collapse [s]",
    "motions before credible",
    "of them blocked",
    "of them deceived",
    "motions blocked after",
)
_BRIEF = (*_HEAD[:2], *_HEAD[3:4], *_HEAD[5:10])
_EACH = ("run", "seed", "credible from [s]", "wrong for [s]", "wrong until [s]", "collapsed [s]",
         "motions before credible", "of them blocked", "of them deceived")  # fmt: skip


def results(courses: Mapping[str, Sequence[Course]], rules: Rules, seed: int) -> LabResults:
    """What all runs of all logs say together."""
    logs = len(next(iter(courses.values())))
    each = [
        (name, seed + k, course) for name, run in courses.items() for k, course in enumerate(run)
    ]
    tables = [
        ResultTable(f"Over {logs} logs", _HEAD, [_row(n, run) for n, run in courses.items()],
                    brief=_BRIEF),
        ResultTable("Log by log", _EACH, [_each_row(*one) for one in each], brief=_EACH),
    ]  # fmt: skip
    numbers = {
        "logs": logs,
        "runs": {name: _summary(run) for name, run in courses.items()},
        "each": [{"run": n, "seed": s, **_numbers(course)} for n, s, course in each],
    }
    return LabResults(
        numbers=numbers,
        tables=tables,
        notes=_notes(rules),
        figures={"two_run": lambda: _figure(courses)},
    )


def _summary(run: Sequence[Course]) -> dict[str, Any]:
    """Medians with their 95 % intervals, shares with theirs, and counts of motions."""
    from_s = [math.inf if c.credible_s is None else c.credible_s for c in run]
    collapsed = sum(c.collapsed_s > 0.0 for c in run)
    waiting = [m for c in run for m in c.waiting]
    return {
        "credible_from_s": _finite(median_interval(from_s)),
        "never_credible": sum(c.credible_s is None for c in run),
        "wrong_for_s": _finite(median_interval([c.wrong_s for c in run])),
        "longest_wrong_until_s": four_digits(max(c.wrong_until_s for c in run)),
        "collapsed_share": [four_digits(v) for v in (collapsed / len(run),
                                               *share_interval(collapsed, len(run)))],
        "longest_collapse_s": four_digits(max(c.collapsed_s for c in run)),
        "motions_before_credible": len(waiting),
        "blocked_before_credible": sum(not m.allowed for m in waiting),
        "deceived_before_credible": sum(m.deceived for m in waiting),
        "motions_after": sum(len(c.motions) for c in run) - len(waiting),
        "blocked_after": sum(not m.allowed for c in run for m in c.motions[len(c.waiting):]),
        "bay_left_s": _finite(median_interval([c.out_s for c in run])),
    }  # fmt: skip


def _numbers(course: Course) -> dict[str, Any]:
    return {
        "credible_from_s": None if course.credible_s is None else four_digits(course.credible_s),
        "wrong_for_s": four_digits(course.wrong_s),
        "wrong_until_s": four_digits(course.wrong_until_s),
        "collapsed_for_s": four_digits(course.collapsed_s),
        "motions": [
            {
                "t_s": four_digits(m.t_s),
                "sigma_m": four_digits(m.sigma_m),
                "clearance_m": four_digits(m.clearance_m),
                "error_m": four_digits(m.error_m),
                "allowed": m.allowed,
            }
            for m in course.motions
        ],
    }


def _row(name: str, run: Sequence[Course]) -> tuple[str, ...]:
    found = _summary(run)
    share, low, high = found["collapsed_share"]
    return (
        name,
        _with_interval(found["credible_from_s"]),
        str(found["never_credible"]),
        _with_interval(found["wrong_for_s"]),
        f"{found['longest_wrong_until_s']:.1f}",
        f"{share:.0%} ({low:.0%} to {high:.0%})",
        f"{found['longest_collapse_s']:.1f}",
        str(found["motions_before_credible"]),
        str(found["blocked_before_credible"]),
        str(found["deceived_before_credible"]),
        f"{found['blocked_after']} of {found['motions_after']}",
    )


def _each_row(name: str, seed: int, course: Course) -> tuple[str, ...]:
    waiting = course.waiting
    return (
        name,
        str(seed),
        "never" if course.credible_s is None else f"{course.credible_s:.1f}",
        f"{course.wrong_s:.1f}",
        f"{course.wrong_until_s:.1f}",
        f"{course.collapsed_s:.1f}",
        str(len(waiting)),
        str(sum(not m.allowed for m in waiting)),
        str(sum(m.deceived for m in waiting)),
    )


def _notes(rules: Rules) -> list[str]:
    return [
        (
            f"tight: standard deviation along the widest axis up to {rules.tight_to_sigma_m:g} m "
            "and one cluster of particles, which is all that the robot can know; right: within "
            f"{rules.right_to_m:g} m and {rules.right_to_deg:g} deg of the truth; credible: tight "
            f"and right for {rules.credible_for_s:g} s on; collapsed: tight and wrong."
        ),
        (
            "A motion is blocked where three sigma towards the nearest obstacle on its way do not "
            "fit into the clearance of the local costmap, and deceived where they do but the error "
            "does not. Motions are driven all the same: the log is the same for all runs."
        ),
        (
            "Medians over the logs with the interval between two order statistics that covers in "
            "95 % or more; shares with the interval of Clopper and Pearson."
        ),
    ]


def _with_interval(values: Sequence[float | None]) -> str:
    median, low, high = (("never" if v is None else f"{v:.1f}") for v in values)
    return median if values[1] is None else f"{median} ({low} to {high})"


def _finite(values: tuple[float, float, float]) -> list[float | None]:
    return [four_digits(v) if math.isfinite(v) else None for v in values]


def _figure(courses: Mapping[str, Sequence[Course]]) -> Figure:
    strips = {
        name: [
            Strip(
                c.t_s,
                c.tight,
                c.right,
                c.credible_s,
                [(m.t_s, m.allowed) for m in c.motions],
            )
            for c in run
        ]
        for name, run in courses.items()
    }
    # The way to show: where the wrong place was held the longest before it was found out.
    every = [c for run in courses.values() for c in run]
    shown = max(every, key=lambda c: (c.credible_s is not None, c.wrong_s))
    way = Way(
        [solid.corners for solid in twin_bays().solids],
        shown.true_xyyaw,
        shown.xyyaw,
        shown.tight,
        shown.right,
    )
    left = [c.out_s for c in every]
    return two_run_figure(strips, way, (min(left), max(left)))
