"""What is held against what: logs by name and content, their numbers block by block."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from slamreplay.bundle.manifest import Source
from slamreplay.gate.baseline_difference import (
    Difference,
    over_logs,
    over_units,
    paired,
    unpaired,
)
from slamreplay.gate.baseline_file import Baseline, kept_name
from slamreplay.gate.baseline_kept import KeptLog, identity_of
from slamreplay.gate.baseline_metrics import MEAN_OF, PER_LOG, expected_nees, has_side
from slamreplay.gate.baseline_words import Compared
from slamreplay.geometry.se2 import Array


@dataclass(frozen=True, eq=False)
class Match:
    """A log and the one of the baseline that it is held against.

    Attributes:
        old_name: in the baseline.
        old: there.
        new: now.
    """

    old_name: str
    old: KeptLog
    new: KeptLog

    @property
    def expected_nees(self) -> float | None:
        """Degrees of freedom of the mean NEES."""
        return expected_nees(self.new.values) or expected_nees(self.old.values)


def match_of(baseline: Baseline, name: str, log: KeptLog) -> Match | None:
    """The log with the one it is held against; None where there is none."""
    old_name = _name_of(baseline, name, log.identity)
    return None if old_name is None else Match(old_name, baseline.logs[old_name], log)


def failed_before(baseline: Baseline, name: str, sources: Iterable[Source]) -> frozenset[str]:
    """Checks of a log that failed: with a limit's `clear`, these hold again only beyond that.

    Args:
        baseline: of an earlier run.
        name: of the log now.
        sources: its files, as its manifest has them.
    """
    old_name = _name_of(baseline, name, identity_of(sources))
    return frozenset() if old_name is None else frozenset(baseline.logs[old_name].failed)


def _name_of(baseline: Baseline, name: str, identity: str) -> str | None:
    """By name and content, by content alone (it was renamed), by name alone (recorded anew)."""
    name = kept_name(name)
    same = [other for other, old in baseline.logs.items() if old.identity == identity]
    if name in same or not same:
        return name if name in baseline.logs else None
    return same[0]


def of_log(match: Match) -> Iterator[Compared]:
    """Every mean over time, then every number of an estimator that drew several seeds."""
    for series, name in MEAN_OF.items():
        before, after = match.old.over_time.get(series), match.new.over_time.get(series)
        if before is None or after is None:
            if before is not None or after is not None:
                yield Compared(name, None, lacks="now" if after is None else "baseline")
        else:
            expected = match.expected_nees if name == "nees_mean" else None
            yield _of_series(name, before, after, match, expected)
    for name in sorted(filter(has_side, {*match.old.seeds, *match.new.seeds})):
        drawn, again = match.old.seeds.get(name), match.new.seeds.get(name)
        if drawn is None or again is None:
            yield Compared(name, None, lacks="now" if again is None else "baseline")
            continue
        # The same seed draws the same numbers, as long as nothing draws more of them in between.
        same = len(drawn) == len(again)
        difference = over_units(drawn, again, by_ratio=True) if same else unpaired(drawn, again)
        yield Compared(name, difference, unit="seeds", infinite=_infinite(drawn, again))


def of_all(matches: Sequence[Match], of_each: Sequence[Compared]) -> Iterator[Compared]:
    """Every number over all logs that have it then and now: a small worsening everywhere.

    Args:
        matches: all of them.
        of_each: what `of_log` said of each.
    """
    told: dict[str, list[Difference]] = {}
    for one in of_each:
        if one.difference is not None:
            told.setdefault(one.name, []).append(one.difference)
    dofs = sorted(dof for match in matches if (dof := match.expected_nees) is not None)
    for name, differences in sorted(told.items(), key=lambda item: _order(item[0])):
        expected = dofs[len(dofs) // 2] if dofs and name == "nees_mean" else None
        yield Compared(name, over_logs(differences), unit="logs", expected=expected)
    single = {name for match in matches for name in {*match.old.values} & {*match.new.values}}
    for name in sorted(single - set(told), key=_order):
        if name not in PER_LOG and not ("." in name and has_side(name)):
            continue
        both = [(match.old.values[name], match.new.values[name]) for match in matches
                if name in match.old.values and name in match.new.values]  # fmt: skip
        old, new = zip(*both, strict=True)
        yield Compared(
            name, over_units(old, new, by_ratio=True), unit="logs", infinite=_infinite(old, new)
        )


def _of_series(
    name: str, before: Array, after: Array, match: Match, expected: float | None
) -> Compared:
    if not match.old.pairs_with(match.new):
        return Compared(name, unpaired(before, after), unit="blocks", expected=expected)
    size = max(len(before), len(after))
    before, after = _padded(before, size), _padded(after, size)
    return Compared(
        name, paired(before, after), unit="blocks", expected=expected,
        alone=int(np.sum(np.isfinite(before) != np.isfinite(after))),
        blocks=(before, after), start_ns=match.new.start_ns, block_s=match.new.block_s,
    )  # fmt: skip


def _order(name: str) -> tuple[int, str]:
    known = (*MEAN_OF.values(), *PER_LOG)
    return known.index(name) if name in known else len(known), name


def _padded(blocks: Array, size: int) -> Array:
    """A number that was unknown at the end of a log has fewer blocks."""
    return np.append(blocks, np.full(size - len(blocks), np.nan))


def _infinite(old: Sequence[float], new: Sequence[float]) -> tuple[int, int]:
    return int(np.isinf(old).sum()), int(np.isinf(new).sum())
