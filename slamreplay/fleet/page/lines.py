"""The fleet in a few lines, for a terminal."""

from __future__ import annotations

from slamreplay.fleet.answers import Answers
from slamreplay.fleet.page import headline, words
from slamreplay.fleet.page.remap import needed
from slamreplay.verdict.words import square_metres

#: Areas that are told, and not counted only.
_MOST_AREAS = 2


def fleet_lines(answers: Answers) -> list[str]:
    """Up to six lines: the sentence, how often, which aisles, which software, what failed."""
    total, areas = answers.total, needed(answers.areas)
    lines = [headline.sentence(answers)]
    rate = total.lost_per_km
    if rate.value is not None:
        within = words.interval_of(rate)
        lines.append(
            f"Became lost {words.two_digits(rate.value)} times per km"
            f"{f' ({within} with 95 % confidence)' if within else ''}, "
            f"{words.hours(total.lost_h)} of {words.hours(total.judged_h)}."
        )
    told = "; ".join(
        f"{words.label(a.site)} at {words.place(a.box_m)} ({square_metres(a.m2)}, "
        f"{words.count(a.logs, 'log')})"
        for a in areas[:_MOST_AREAS]
    )
    more = f"; and {len(areas) - _MOST_AREAS:,} more" if len(areas) > _MOST_AREAS else ""
    if told:
        lines.append(f"Aisles that need re-mapping: {told}{more}.")
    elif total.lost.n:
        lines.append("No aisle needs re-mapping.")
    worse = [step for step in answers.steps if step.verdict == "worse"]
    if worse:
        step = headline.newest(worse)
        lines.append(
            f"Software {step.after} is worse than {step.before}: "
            f"{words.share_of(step.was)} to {words.share_of(step.now)} of logs "
            f"{headline.measure_words(step.measure)}."
        )
    if total.failed:
        lines.append(f"{words.count(total.failed, 'log')} could not be read or judged.")
    return lines
