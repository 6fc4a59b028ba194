"""Checks of numbers against their limits: `limit/...`."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Iterator, Sequence

import numpy as np

from slamreplay.gate.measures import Measure, Measures, Series
from slamreplay.gate.outcome import Outcome, Status
from slamreplay.gate.rules import Limit
from slamreplay.gate.trigger import Excursion, excursions
from slamreplay.geometry.times import NS_PER_S, ns


def limited(
    limits: Sequence[Limit], measures: Measures, failed_before: Collection[str] = ()
) -> Iterator[Outcome]:
    """One outcome for each limit; of a metric with several the later ones are numbered.

    Args:
        limits: of the rules.
        measures: of the log.
        failed_before: checks that failed in the run that was accepted as the baseline: a number per
            log that failed then must be back on this side of `clear`.
    """
    seen: Counter[str] = Counter()
    for limit in limits:
        seen[limit.metric] += 1
        number = seen[limit.metric]
        check = f"limit/{limit.metric}" + (f"/{number}" if number > 1 else "")
        if limit.metric in measures.series:
            yield _over_time(check, limit, measures.series[limit.metric], measures)
        elif limit.metric in measures.values:
            before = check in failed_before
            yield _per_log(check, limit, measures.values[limit.metric], failed_before=before)
        else:
            why = measures.missing.get(limit.metric, "no such estimator was run")
            yield Outcome(check, _title(limit), "skipped", "error", why)


def _per_log(check: str, limit: Limit, one: Measure, *, failed_before: bool) -> Outcome:
    unit, value = one.unit, one.value
    text = f"{_number(value, unit)}{_interval(one)}"
    for above, bound in _sides(limit):
        held = limit.clear if failed_before and limit.clear is not None else bound
        if not _is_beyond(value, held, above=above):
            continue
        text += f", {'above' if above else 'below'} {_number(held, unit)}"
        if held != bound:
            text += f": it failed before, so that clear holds and not {_number(bound, unit)}"
        return _outcome(check, limit, "failed", text, (value, held, unit))
    return _outcome(check, limit, "passed", text, (value, _bound(limit), unit))


def _over_time(check: str, limit: Limit, series: Series, measures: Measures) -> Outcome:
    unit = series.unit
    for above, bound in _sides(limit):
        clear = bound if limit.clear is None else limit.clear
        found = excursions(
            series.t_ns, series.values, bound, clear, above=above, for_ns=ns(limit.for_s)
        )
        if found:
            return _failed(check, limit, found, measures, unit, bound, above=above)
    known = series.values[np.isfinite(series.values)]
    is_most = limit.maximum is not None
    extreme = float(known.max() if is_most else known.min())
    text = f"{'greatest' if is_most else 'least'} {_number(extreme, unit)}"
    if any(_is_beyond(extreme, bound, above=above) for above, bound in _sides(limit)):
        text += f", beyond {_number(_bound(limit), unit)} never for {limit.for_s:g} s"
    return _outcome(check, limit, "passed", text, (extreme, _bound(limit), unit))


def _failed(
    check: str,
    limit: Limit,
    found: Sequence[Excursion],
    measures: Measures,
    unit: str,
    bound: float,
    *,
    above: bool,
) -> Outcome:
    """The worst stretch is where it is shown; the first of those that are equally bad."""
    worst = max(found, key=lambda one: one.worst if above else -one.worst)
    end_ns = max(worst.start_ns, min(worst.end_ns, measures.end_ns))
    total_s = sum(one.duration_ns for one in found) / NS_PER_S
    first, last = ((t - measures.start_ns) / NS_PER_S for t in (worst.start_ns, end_ns))
    side, to = ("above", "up to") if above else ("below", "down to")
    several = f" in {len(found)} stretches, the worst" if len(found) > 1 else ""
    text = (
        f"{side} {_number(bound, unit)} for {total_s:.1f} s{several} from {first:.1f} to "
        f"{last:.1f} s, {to} {_number(worst.worst, unit)}"
    )
    span = worst.start_ns, end_ns
    return _outcome(check, limit, "failed", text, (worst.worst, bound, unit), span)


def _outcome(
    check: str,
    limit: Limit,
    status: Status,
    text: str,
    told: tuple[float, float, str],
    span: tuple[int | None, int | None] = (None, None),
) -> Outcome:
    value, bound, unit = told
    known = value if math.isfinite(value) else None  # JSON has no infinity
    return Outcome(check, _title(limit), status, "error", text, *span, known, bound, unit)


def _title(limit: Limit) -> str:
    bounds = [f"{'at most' if above else 'at least'} {b:g}" for above, b in _sides(limit)]
    lasting = f" but for less than {limit.for_s:g} s" if limit.for_s else ""
    return f"{limit.metric} {' and '.join(bounds)}{lasting}"


def _sides(limit: Limit) -> list[tuple[bool, float]]:
    """Whether it must not be above, or not be below, and what."""
    sides = ((True, limit.maximum), (False, limit.minimum))
    return [(above, bound) for above, bound in sides if bound is not None]


def _bound(limit: Limit) -> float:
    return _sides(limit)[0][1]


def _is_beyond(value: float, bound: float, *, above: bool) -> bool:
    return value > bound if above else value < bound


def _number(value: float, unit: str) -> str:
    if math.isinf(value):
        return "without a single pose"
    return f"{value:.4g} {unit}".rstrip()


def _interval(one: Measure) -> str:
    if one.low is None or one.high is None:
        seeds = len(one.of_seeds)
        return f", the worst of {seeds} seeds" if seeds > 1 else ""
    return f" (95 % interval {one.low:.4g} to {one.high:.4g})"
