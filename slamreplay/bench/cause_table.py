"""The benchmark of root causes as a page: the confusion matrix, rates, and every wrong answer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from slamreplay.bench.cause_scores import NAMES

#: Column heads that fit a page.
SHORT: dict[str, str] = {
    "sensing_ambiguity": "ambiguity",
    "association_error": "association",
    "optimization_drift": "drift",
    "stale_map_use": "stale map",
    "timing": "timing",
    "odometry_slip": "slip",
    "wrong_initial_pose": "start",
    "kidnapped": "kidnapped",
    "overconfidence": "overconf.",
    "wrong_map": "wrong map",
    "none": "none",
}


def causes_page(results: Mapping[str, Any]) -> str:
    """Markdown of what `slamreplay.bench.cause_runner` found."""
    lines = ["# Root causes: the benchmark", ""]
    lines.append(
        f"{results['logs']} {results['split']} logs of seed {results['seed']}. An incident is a "
        "log in which, by the truth, the robot got lost or the map was contradicted, and which "
        "does not do so when the thing that was done to it is left out. Intervals are Wilson's, "
        "95 %."
    )
    for name, scores in results["answerers"].items():
        lines += ["", f"## {name}", "", *_figures(scores)]
        lines += ["", "### Confusion matrix", "", *_confusion(scores["confusion"])]
        lines += ["", "### By kind of incident", "", *_rates(scores["by_kind"], "kind")]
        lines += ["", "### By cause", "", *_rates(scores["by_label"], "known cause")]
        lines += ["", "### Reliability", "", *_reliability(scores["calibration"])]
        lines += ["", "### Named wrongly", "", *_wrong(results["cases"], name)]
    return "\n".join(lines) + "\n"


def _figures(s: Mapping[str, Any]) -> list[str]:
    calm = s["no_incident"]
    rows = [
        ("incidents with a known cause", str(s["incidents"]), ""),
        ("cause named right", _plain(s["accuracy"][0], 3), _between(s["accuracy"])),
        ("mean of the causes' own shares", _plain(s["balanced_accuracy"], 3), ""),
        ("right among the first two", _plain(s["among_first_two"][0], 3),
         _between(s["among_first_two"])),
        ("expected calibration error", _plain(s["calibration"]["ece"], 3), ""),
        ("logs in which nothing happened", str(calm["logs"]), ""),
        ("of those: none / what was put in / something else",
         f"{calm['none']} / {calm['what_was_put_in']} / {calm['something_else']}", ""),
        ("logs without a known cause, left out", str(s["unknown_cause"]), ""),
        ("logs that failed, counted as wrong", str(s["failed"]), ""),
        ("replays, median / most",
         f"{_plain(s['trials']['median'], 0)} / {_plain(s['trials']['max'], 0)}", ""),
        ("CPU for a cause [s], median / 95 %",
         f"{_plain(s['cpu_s']['median'], 1)} / {_plain(s['cpu_s']['p95'], 1)}", ""),
    ]  # fmt: skip
    return _table(("figure", "value", "95 % interval"), rows)


def _confusion(matrix: Mapping[str, Mapping[str, int]]) -> list[str]:
    head = ("known cause", *(SHORT[n] for n in NAMES))
    rows = []
    for label, said in matrix.items():
        right = label.split(" or ")
        cells = [
            "" if n not in said else f"**{said[n]}**" if n in right else str(said[n]) for n in NAMES
        ]
        rows.append((label.replace("_", " "), *cells))
    return _table(head, rows)


def _rates(parts: Mapping[str, Any], head: str) -> list[str]:
    rows = [
        (k.replace("_", " "), str(p["logs"]), _plain(p["share"][0], 2), _between(p["share"]))
        for k, p in parts.items()
    ]
    return _table((head, "incidents", "right", "95 % interval"), rows)


def _reliability(calibration: Mapping[str, Any]) -> list[str]:
    rows = [
        (f"{b['low']:.1f}", str(b["moments"]), f"{b['said']:.3f}", f"{b['right']:.3f}")
        for b in calibration["bins"]
    ]
    return _table(("probability from", "answers", "said", "right"), rows)


def _wrong(cases: Sequence[Mapping[str, Any]], name: str) -> list[str]:
    """The surest mistakes first."""
    wrong = [c for c in cases if "error" in c or (c["is_incident"] and not c["right"][name])]
    wrong.sort(key=lambda c: (-(_probability(c, name) or 0.0), c["case"]))
    rows = []
    for c in wrong:
        if "error" in c:
            rows.append((c["case"], "", "", "", c["error"]))
            continue
        said = c["said"][name]
        text = said["text"] if len(said["text"]) <= 160 else said["text"][:157] + "..."
        sure = _plain(_probability(c, name), 2)
        rows.append((c["case"], c["label"].replace("_", " "), said["kind"].replace("_", " "),
                     sure, text.replace("|", "/")))  # fmt: skip
    return _table(("case", "known cause", "said", "probability", "because"), rows)


def _probability(case: Mapping[str, Any], name: str) -> float | None:
    return None if "error" in case else case["said"][name]["probability"]


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return lines + ["| " + " | ".join(row) + " |" for row in rows]


def _between(rate: Sequence[float | None]) -> str:
    low, high = rate[1], rate[2]
    return "" if low is None or high is None else f"{low:.2f} to {high:.2f}"


def _plain(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{value:.{digits}f}"
