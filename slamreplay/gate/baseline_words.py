"""What a comparison with the baseline is called, how it ends and how it is told."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from slamreplay.evidence.clean import straight
from slamreplay.gate.baseline_difference import UNITS_MIN, Difference
from slamreplay.gate.baseline_kept import KeptLog
from slamreplay.gate.baseline_metrics import is_worse, margin_of, metric_named
from slamreplay.gate.outcome import Outcome, Status
from slamreplay.gate.rules import BaselineRules
from slamreplay.geometry.se2 import Array
from slamreplay.geometry.times import NS_PER_S

#: How well a robot fares, the best first; what could not be judged lies between.
_RANK = ("healthy", "map_changed", "unobservable", "insufficient_data", "lost",
         "lost_and_map_changed")  # fmt: skip
_NAMED = 5


@dataclass(frozen=True, eq=False)
class Compared:
    """A number then and now.

    Attributes:
        name: of the number; of one over time its mean.
        difference: None where one side lacks it.
        lacks: the side that does: `now` or `baseline`.
        unit: what was compared: blocks, seeds or logs.
        expected: see `is_worse`.
        alone: blocks of which only one side knows the number.
        infinite: seeds or logs without a single pose, then and now.
        blocks: the paired block means.
        start_ns: of the log.
        block_s: width of a block.
    """

    name: str
    difference: Difference | None
    lacks: str = ""
    unit: str = ""
    expected: float | None = None
    alone: int = 0
    infinite: tuple[int, int] = (0, 0)
    blocks: tuple[Array, Array] | None = None
    start_ns: int = 0
    block_s: int = 0

    @property
    def p_value(self) -> float | None:
        """Of no difference; None where nothing was tested."""
        return None if self.difference is None else self.difference.p_value


def of_comparison(
    one: Compared, corrected: float | None, tests: int, rules: BaselineRules
) -> Outcome:
    """How a comparison ends.

    Args:
        one: the comparison.
        corrected: its p-value after Holm; None where nothing was tested.
        tests: that were made in this run.
        rules: level and margins.
    """
    metric = metric_named(one.name)
    unit = "" if metric is None else metric.unit
    title = f"{one.name} as in the baseline"
    d = one.difference
    before, after = one.infinite
    if before != after:
        status: Status = "failed" if after > before else "passed"
        hint = "" if after > before else "; better: commit a new baseline"
        text = f"{one.unit} without a single pose: {before} in the baseline, {after} now{hint}"
        return _outcome(one, title, status, text, float(after - before), 0.0, "")
    if d is None or not d.n:
        return _outcome(one, title, "skipped", _lacking(one), None, None, unit)
    margin = margin_of(one.name, d.old, rules)
    if d.identical:
        text = f"no difference: the same in all {d.n} {one.unit}"
        return _outcome(one, title, "passed", text + _alone(one), 0.0, margin, unit)
    change = _change(d, unit)
    worse = is_worse(one.name, d.old, d.new, one.expected)
    if d.enough and corrected is not None:
        found = f"p = {d.p_value:.1g}, {corrected:.1g} after Holm over {tests} tests"
        sure = corrected < rules.alpha
        lead = "no difference that is sure"
    else:
        found, sure = f"{_worth(one, d)}, {d.needed} are needed", False
        lead = "insufficient"
    gross = worse and one.blocks is not None and 0.0 < margin * (rules.gross or 0.0) < abs(d.mean)
    status = "passed" if d.enough else "skipped"
    if sure and abs(d.mean) <= margin:  # gross is never less than a margin
        text = f"sure, but within the margin of {_said(margin, unit)}: {change} ({found})"
    elif sure and not worse:
        text = f"{change}, better: commit a new baseline (margin {_said(margin, unit)}; {found})"
    elif sure or gross:
        status = "failed"
        fact = "" if sure else "not sure to recur, but a fact of this log; "
        text = f"{change}, worse ({fact}margin {_said(margin, unit)}; {found})"
    else:
        text = f"{lead}: {change} ({found})"
    return _outcome(one, title, status, text + _alone(one), d.mean, margin, unit)


def of_state(old: KeptLog, new: KeptLog) -> Outcome:
    """Whether the verdict on a log is still the same: a fact, and no test is needed."""
    check, title = "baseline/state", "verdict as in the baseline"
    change = f"{straight(old.state)} in the baseline, {new.state} now"
    if old.state == new.state:
        return Outcome(check, title, "passed", "error", f"still {new.state}")
    if old.identity != new.identity:
        return Outcome(check, title, "passed", "error", f"{change}, of another log")
    if _rank(new.state) > _rank(old.state):
        return Outcome(check, title, "failed", "error", f"{change}, of the same log")
    return Outcome(check, title, "passed", "error", f"{change}; better: commit a new baseline")


def of_match(new: KeptLog, old: KeptLog | None, name: str, old_name: str) -> Outcome:
    """What a log is held against."""
    check, title = "baseline/log", "the log is in the baseline"
    if old is None:
        text = "not in the baseline: commit a new one"
        return Outcome(check, title, "skipped", "warning", text)
    if old.identity != new.identity:
        text = "another log than in the baseline: means are compared, not moment by moment"
    elif not old.pairs_with(new):
        text = "the same log, cut otherwise: means are compared, not moment by moment"
    else:
        text = "the same log: compared moment by moment"
    if old_name != name:
        text += f"; there it is {straight(old_name)[:200]}"
    return Outcome(check, title, "passed", "warning", text)


def of_logs(matched: int, gone: Sequence[str], fresh: Sequence[str]) -> Outcome:
    """Whether the gate judged what the baseline did."""
    check, title = "baseline/logs", "all logs of the baseline were judged"
    parts = [f"{matched} of the baseline judged again"]
    if gone:
        parts.append(f"{len(gone)} of the baseline not judged now: {_names(gone)}")
    if fresh:
        parts.append(f"{len(fresh)} not in the baseline: {_names(fresh)}")
    if matched < UNITS_MIN:
        parts.append(f"{UNITS_MIN} are needed to judge them together")
    status: Status = "skipped" if gone else "passed"
    return Outcome(check, title, status, "warning", "; ".join(parts))


def _outcome(
    one: Compared, title: str, status: Status, text: str,
    value: float | None, limit: float | None, unit: str,
) -> Outcome:  # fmt: skip
    start = end = None
    if status == "failed" and one.blocks is not None:
        start, end = _worst_block(one)
    value = None if value is None or not math.isfinite(value) else value
    return Outcome(f"baseline/{one.name}", title, status, "error", text, start, end, value, limit,
                   unit)  # fmt: skip


def _worst_block(one: Compared) -> tuple[int, int]:
    """The block that changed most in the direction of the mean."""
    assert one.blocks is not None
    assert one.difference is not None
    step = (one.blocks[1] - one.blocks[0]) * math.copysign(1.0, one.difference.mean)
    block = int(np.nanargmax(step))
    start = one.start_ns + block * one.block_s * NS_PER_S
    return start, start + one.block_s * NS_PER_S


def _change(d: Difference, unit: str) -> str:
    known = math.isfinite(d.low)
    interval = f" [{d.low:+.3g} to {d.high:+.3g}]" if known else ""
    return f"{d.old:.4g} -> {_said(d.new, unit, 4)}, {d.mean:+.3g}{interval}"


def _said(value: float, unit: str, digits: int = 3) -> str:
    return f"{value:.{digits}g} {unit}".rstrip()


def _worth(one: Compared, d: Difference) -> str:
    if one.unit != "blocks":
        return f"{d.n} {one.unit}"
    return f"{d.n} blocks are worth {math.floor(d.n_eff)} independent ones"


def _alone(one: Compared) -> str:
    """Told, for a number that is known less often may look better for it."""
    return f"; {one.alone} blocks have it on one side only" if one.alone else ""


def _lacking(one: Compared) -> str:
    if one.lacks == "baseline":
        return "not in the baseline: commit a new one"
    if one.lacks == "now":
        return "in the baseline, but not measured now"
    return "no moment at which both have it"


def _rank(state: str) -> int:
    return _RANK.index(state) if state in _RANK else len(_RANK)


def _names(names: Sequence[str]) -> str:
    shown = ", ".join(straight(name)[:200] for name in names[:_NAMED])
    return shown + (f" and {len(names) - _NAMED} more" if len(names) > _NAMED else "")
