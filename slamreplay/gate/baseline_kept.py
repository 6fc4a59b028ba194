"""What is kept of a log, so that a later run of the gate can be held against it.

Of a number over time the means of blocks: they lie on one grid from the log's start on, so that
those of two runs on the same log pair, and they hold what the memory of the number can be told
from. A log has at most `BLOCKS_MAX` of them, a few kilobytes for all its numbers.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from slamreplay.bundle.manifest import Source
from slamreplay.gate.baseline_metrics import MEAN_OF
from slamreplay.gate.measures import Measure, Measures, Series
from slamreplay.gate.outcome import Outcome
from slamreplay.geometry.se2 import Array
from slamreplay.geometry.times import NS_PER_S

BLOCKS_MAX = 120
#: Widths of a block in s: round ones, so that a log that is cut a little shorter has the same.
_WIDTHS = (1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1200, 1800, 3600)
#: Digits of a block's mean and of a number per log. Rounding noise of another machine lies below.
_DIGITS, _DIGITS_PER_LOG = 4, 6


@dataclass(frozen=True, eq=False)
class KeptLog:
    """One log, as a baseline has it.

    Attributes:
        identity: of its content: 32 hex digits over the hashes of its files.
        start_ns: of the log, where the grid begins.
        end_ns: of it.
        state: of the verdict.
        block_s: width of a block.
        over_time: block means (B,) by the number's name, NaN where nothing was known.
        values: one number per log by name; infinite of an estimator without a pose.
        seeds: of numbers of estimators that drew several seeds, one value for each.
        failed: checks that failed.
    """

    identity: str
    start_ns: int
    end_ns: int
    state: str
    block_s: int
    over_time: Mapping[str, Array] = field(default_factory=dict)
    values: Mapping[str, float] = field(default_factory=dict)
    seeds: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    failed: tuple[str, ...] = ()

    def pairs_with(self, other: KeptLog) -> bool:
        """Whether blocks of both are of the same moments of the same log."""
        mine = (self.identity, self.start_ns, self.block_s)
        return mine == (other.identity, other.start_ns, other.block_s)


def kept_log(
    measures: Measures,
    sources: Iterable[Source],
    state: str,
    outcomes: Sequence[Outcome] = (),
) -> KeptLog:
    """What is kept of a log that was measured and judged.

    Args:
        measures: of it.
        sources: its files, as its manifest has them.
        state: of its verdict.
        outcomes: of its checks; those against an earlier baseline are not kept.
    """
    width = block_width(measures.end_ns - measures.start_ns)
    over_time = {name: blocks_of(measures.series[name], measures.start_ns, width)
                 for name in MEAN_OF if name in measures.series}  # fmt: skip
    values = {name: _digits(one.value, _DIGITS_PER_LOG) for name, one in measures.values.items()}
    return KeptLog(
        identity=identity_of(sources),
        start_ns=measures.start_ns,
        end_ns=measures.end_ns,
        state=state,
        block_s=width,
        over_time={name: blocks for name, blocks in over_time.items() if np.isfinite(blocks).any()},
        values={name: value for name, value in values.items() if not np.isnan(value)},
        seeds={name: _seeds(one) for name, one in measures.values.items() if len(one.of_seeds) > 1},
        failed=tuple(o.check for o in outcomes
                     if o.status == "failed" and not o.check.startswith("baseline/")),
    )  # fmt: skip


def identity_of(sources: Iterable[Source]) -> str:
    """Of a log's content, whatever its files are called and in whatever order they are given."""
    hashes = sorted(source.sha256 for source in sources)
    return hashlib.sha256("\n".join(hashes).encode()).hexdigest()[:32]


def block_width(duration_ns: int) -> int:
    """Width of a block in s of a log of this length."""
    return next((w for w in _WIDTHS if duration_ns <= w * BLOCKS_MAX * NS_PER_S),
                -(-duration_ns // (BLOCKS_MAX * NS_PER_S)))  # fmt: skip


def blocks_of(series: Series, start_ns: int, width_s: int) -> Array:
    """(B,) means of the known values in each block from the log's start on, NaN without one."""
    block = (series.t_ns - start_ns) // (width_s * NS_PER_S)
    known = np.isfinite(series.values) & (block >= 0) & (block < BLOCKS_MAX)
    block = block[known]
    count = np.bincount(block)
    total = np.bincount(block, weights=series.values[known])
    mean = np.full(len(count), np.nan)
    np.divide(total, count, out=mean, where=count > 0)
    return np.array([_digits(value, _DIGITS) for value in mean.tolist()])


def _seeds(of: Measure) -> tuple[float, ...]:
    return tuple(_digits(value, _DIGITS_PER_LOG) for value in of.of_seeds)


def _digits(value: float, digits: int) -> float:
    """Rounded as the file has it, so that what was never in a file compares alike."""
    return float(f"{value:.{digits}g}") + 0.0  # no -0.0
