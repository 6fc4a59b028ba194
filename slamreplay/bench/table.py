"""The benchmark as a page of tables, goals beside the figures and every failure with its case."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from slamreplay.bench.baselines import FIELD_THRESHOLDS

#: Figure to its path in the scores, the goal as printed, and how many digits it has.
_ROWS: tuple[tuple[str, tuple[str, ...], str, int], ...] = (
    ("state of the log right (4 classes)", ("log_accuracy",), ">= 0.99", 3),
    ("wrong map told", ("wrong_map_told",), "1", 3),
    ("lost, F1 per moment", ("lost", "f1"), ">= 0.995", 4),
    ("lost, precision", ("lost", "precision"), "", 4),
    ("lost, recall", ("lost", "recall"), "", 4),
    ("lost, F1 with the edges", ("lost_with_edges", "f1"), "", 4),
    ("changed, F1 per moment", ("changed", "f1"), ">= 0.98", 4),
    ("changed, precision", ("changed", "precision"), "", 4),
    ("changed, recall", ("changed", "recall"), "", 4),
    ("changed, F1 with the edges", ("changed_with_edges", "f1"), "", 4),
    ("AUC lost against changed", ("auc_lost_against_changed",), ">= 0.999", 4),
    (
        "AUC one identical aisle off against changed",
        ("auc_identical_aisle_against_changed",),
        ">= 0.99",
        4,
    ),
    ("hindsight error, median [m]", ("hindsight", "median_m"), "<= 0.03", 3),
    ("hindsight error, 95 % [m]", ("hindsight", "p95_m"), "<= 0.10", 3),
    ("hindsight off by over 0.5 m", ("hindsight", "over_half_m"), "", 4),
    ("moments with a hindsight pose", ("hindsight", "coverage"), "", 3),
    ("moments not judged", ("unjudged_share",), "", 4),
    ("changed regions found", ("regions", "recall"), "", 3),
    ("false changed area per log [m2]", ("regions", "false_area_m2_per_log"), "", 3),
    ("expected calibration error", ("calibration", "ece"), "<= 0.02", 3),
)
#: The columns of the tables by kind and by condition.
_PARTS: tuple[tuple[str, tuple[str, ...], int], ...] = (
    ("log right", ("log_accuracy",), 2),
    ("lost F1", ("lost", "f1"), 3),
    ("changed F1", ("changed", "f1"), 3),
    ("AUC", ("auc_lost_against_changed",), 3),
    ("hindsight median [m]", ("hindsight", "median_m"), 3),
    ("95 % [m]", ("hindsight", "p95_m"), 3),
    ("not judged", ("unjudged_share",), 3),
    ("regions", ("regions", "recall"), 2),
    ("false area [m2]", ("regions", "false_area_m2_per_log"), 2),
    ("ECE", ("calibration", "ece"), 3),
)


def page(results: Mapping[str, Any]) -> str:
    """Markdown of what `slamreplay.bench.runner` found."""
    total = results["scores"]
    told = (
        f"{total['logs']} {results['split']} logs of seed {results['seed']}. The intervals hold 95 "
        "of 100 resamples of the logs. Moments within 0.5 s of a true edge are left out."
    )
    figures: list[tuple[str, ...]] = [
        (title, _number(_at(total, path), digits), _interval(_at(total, path), digits), goal)
        for title, path, goal, digits in _ROWS
    ]
    on_healthy = f"{total['lost_on_healthy_logs']} of {total['healthy_logs']}"
    figures += [("healthy logs called lost", on_healthy, "", "0"), *_delay_rows(total)]
    lines = ["# Lost or changed: the benchmark", "", told, ""]
    lines += _table(("figure", "value", "95 % interval", "goal"), figures)
    lines += ["", "## Baselines, at the believed pose", ""]
    best = "F1 at the best threshold for these very logs"
    head: tuple[str, ...] = (
        "lost by",
        "AUC lost",
        "AUC lost against changed",
        "F1 at its field threshold",
        best,
    )
    bars = [_baseline_row(name, total) for name in FIELD_THRESHOLDS]
    ours = (_number(total["auc_lost_against_changed"], 3), "", _number(total["lost"]["f1"], 3))
    lines += _table(head, [*bars, ("slamreplay", "", *ours)])
    for title, key in (("By kind", "kinds"), ("By hard condition", "conditions")):
        parts = results[key]
        head = (title.split()[-1], "logs", *(name for name, _, _ in _PARTS))
        rows = [
            (name, str(part["logs"]), *(_number(_part(part, path), d) for _, path, d in _PARTS))
            for name, part in parts.items()
        ]
        lines += ["", f"## {title}", "", *_table(head, rows)]
    lines += ["", "## Failure modes named", ""]
    modes = results["failure_modes"]
    lines += _table(
        ("kind", "what it began with, in logs"),
        [(k, ", ".join(f"{m.replace('_', ' ')} {n}" for m, n in v.items()))
         for k, v in modes.items()],
    )  # fmt: skip
    lines += ["", "## Reliability", ""]
    head = ("confidence from", "moments", "logs", "said", "right")
    lines += _table(
        head,
        [
            (f"{b['low']:.1f}", str(b["moments"]), str(b["logs"]), f"{b['said']:.3f}",
             f"{b['right']:.3f}")
            for b in total["calibration"]["bins"]
        ],
    )  # fmt: skip
    lines += ["", "## Logs judged otherwise than the truth has them", ""]
    head = ("case", "truth", "judged", "lost share (true)", "changed share (true)",
            "hindsight 95 % [m]", "findings")  # fmt: skip
    lines += _table(head, [_failure(one) for one in results["cases"] if not one["right"]])
    return "\n".join(lines) + "\n"


def _delay_rows(total: Mapping[str, Any]) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = []
    for name in ("lost", "changed"):
        delay = total[name]["delay_s"]
        text = f"{_plain(delay['median'], 1)} / {_plain(delay['p95'], 1)}"
        where = f"{delay['missed']} of {delay['stretches']} stretches missed"
        rows.append((f"{name}, found after [s], median / 95 %", text, where, ""))
    return rows


def _baseline_row(name: str, total: Mapping[str, Any]) -> tuple[str, ...]:
    b = total["baselines"][name]
    field = f"{_number(b['f1_lost_field'], 3)} (at {_plain(b['threshold_field'], 3)})"
    best = f"{_number(b['f1_lost_best'], 3)} (at {_plain(b['threshold_best'], 3)})"
    return (
        name.replace("_", " "),
        _number(b["auc_lost"], 3),
        _number(b["auc_lost_against_changed"], 3),
        field,
        best,
    )


def _failure(one: Mapping[str, Any]) -> tuple[str, ...]:
    if "error" in one:
        return (one["case"], "", one["error"], "", "", "", "")
    return (
        one["case"],
        one["state"],
        one["judged"],
        f"{one['judged_lost_share']:.2f} ({one['lost_share']:.2f})",
        f"{one['judged_changed_share']:.2f} ({one['changed_share']:.2f})",
        _plain(one["hindsight_p95_m"], 2),
        " ".join(f for f in one["findings"] if f.startswith(("SR-MAP", "SR-LOC"))),
    )


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return lines + ["| " + " | ".join(row) + " |" for row in rows]


def _at(scores: Mapping[str, Any], path: Sequence[str]) -> Any:
    found: Any = scores
    for key in path:
        found = found[key]
    return found


def _part(scores: Mapping[str, Any], path: Sequence[str]) -> Any:
    """A map of elsewhere has one right answer, which is none of the four states."""
    found = _at(scores, path)
    return scores["wrong_map_told"] if path == ("log_accuracy",) and found[0] is None else found


def _number(rate: Sequence[float | None], digits: int) -> str:
    return _plain(rate[0], digits)


def _interval(rate: Sequence[float | None], digits: int) -> str:
    if rate[1] is None or rate[2] is None:
        return ""
    return f"{rate[1]:.{digits}f} to {rate[2]:.{digits}f}"


def _plain(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{value:.{digits}f}"
