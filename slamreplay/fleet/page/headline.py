"""How is my fleet: one sentence, three numbers, and how alarming they are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from slamreplay.fleet.answers import LEAST_LOGS, Answers, Area, Group, Step
from slamreplay.fleet.page import words
from slamreplay.fleet.page.remap import needed
from slamreplay.verdict.words import square_metres

#: An aisle in which fewer of the lost logs than this share were lost explains nothing.
_TELLS = 0.1


@dataclass(frozen=True)
class Fact:
    """One number, what it is, what to hold it against, and the section that tells more.

    Where there is no number a word stands in its place, and needs no label.
    """

    number: str
    label: str
    detail: str
    link: str
    more: str
    alarming: bool = False


def sentence(answers: Answers) -> str:
    """The fleet in one sentence."""
    total = answers.total
    if not total.logs:
        return "There is no log to tell of yet."
    days = sum(group.name is not None for group in answers.by["day"])
    start = f"f {words.logs_of_robots(total)}"
    start += f" in {words.count(days, 'day')}" if days else ""
    lost = total.lost.count
    how = "was" if lost == 1 else "were"
    begin = f"O{start} {lost:,} {how} lost" if lost else f"None o{start} was lost"
    # Who reads "none was lost" of logs that say nothing is misled.
    blind = f" ({total.logs - total.lost.n:,} could not be judged)" if _is_blind(total) else ""
    explained = _explained(answers) if total.lost.n else ""  # what nobody judged tells of no map
    return f"{begin}{blind}{explained}."


def tone(answers: Answers) -> str:
    """The state whose colour the page has."""
    if answers.total.lost.count:
        return "lost"
    if needed(answers.areas):
        return "map_changed"
    return "healthy" if answers.total.lost.n else "insufficient_data"


def facts(answers: Answers) -> tuple[Fact, Fact, Fact]:
    """Which aisles need re-mapping, how often robots get lost, and whether software got worse."""
    return _areas(answers), _rate(answers), _software(answers.steps)


def _is_blind(total: Group) -> bool:
    """Whether most logs say nothing."""
    return 2 * total.lost.n < total.logs


def _explained(answers: Answers) -> str:
    """What explains most of the lost logs, an aged aisle or a version, and what else is to do."""
    areas, lost = needed(answers.areas), answers.total.lost.count
    no_map = "" if _is_blind(answers.total) else "; no map has to be made again"
    if not lost:
        return _to_map(areas) if areas else no_map.replace(";", ", and")
    aisle = max(areas, key=lambda area: area.lost_near, default=None)
    beside = aisle.lost_near if aisle is not None else 0
    step = _lost_more(answers.steps)
    if step is not None and _beyond(step) > beside:
        told = f"; {_part(step.now.count, lost)} with software {step.after}"
        return told + (_to_map(areas) if areas else no_map)
    if aisle is None:
        return no_map
    if beside < _TELLS * lost:
        return _to_map(areas)
    told = f"; {_part(beside, lost)} in one aisle of {_site(aisle)} whose map has aged"
    return told if step is None else f"{told}; software {step.after} got worse"


def _beyond(step: Step) -> float:
    """How many more logs were lost than with the version before, as often as that one lost its."""
    return step.now.count - (step.was.value or 0.0) * step.now.n


def _part(some: int, lost: int) -> str:
    if some < lost:
        return f"{some:,} of them"
    return "it" if lost == 1 else "all of them"


def _to_map(areas: Sequence[Area]) -> str:
    many = "one place has" if len(areas) == 1 else f"{len(areas):,} places have"
    where = "at" if len(areas) == 1 else "the first at"
    return f"; {many} to be mapped again, {where} {_site(areas[0])}"


def _lost_more(steps: Sequence[Step]) -> Step | None:
    """The newest version that loses robots more often than the one before."""
    worse = [step for step in steps if step.verdict == "worse" and step.measure == "lost"]
    return worse[-1] if worse else None


def _site(area: Area) -> str:
    if area.site is None:
        return "a site not told"
    return area.site if area.site.lower().startswith("site") else f"site {area.site}"


def _areas(answers: Answers) -> Fact:
    areas, found = answers.areas, needed(answers.areas)
    if not answers.total.lost.n:
        detail = "Which aisles need re-mapping: no log could be judged."
        return Fact("unknown", "", detail, "#remap", "See it")
    if not found:
        watched = sum(area.advice == "watch" for area in areas)
        detail = "No part of a map stays contradicted by logs."
        if watched:
            detail = f"{words.count(watched, 'place')} may become one: nothing more is known yet."
        return Fact("none", "", f"Aisles that need re-mapping. {detail}", "#remap", "See them")
    first = found[0]
    detail = (
        f"First {_site(first)}, {words.place(first.box_m)}: {square_metres(first.m2)}, since "
        f"{words.day(first.first_day)}, seen by {words.count(first.logs, 'log')} of "
        f"{words.count(first.robots, 'robot')}."
    )
    name = "aisle needs re-mapping" if len(found) == 1 else "aisles need re-mapping"
    return Fact(f"{len(found):,}", name, detail, "#remap", "See which", alarming=True)


def _rate(answers: Answers) -> Fact:
    total, rate = answers.total, answers.total.lost_per_km
    within = words.interval_of(rate)
    detail = f"{within} with 95 % confidence. " if within else ""
    detail += (
        f"{words.hours(total.lost_h)} lost of {words.hours(total.judged_h)}; "
        f"{words.count(total.stops, 'unplanned stop')}."
    )
    if rate.value is None:
        return Fact(
            "unknown", "", f"How often robots get lost per km. {detail}", "#robots", "See whose"
        )
    return Fact(
        f"{words.two_digits(rate.value)} per km",
        "is how often robots become lost",
        detail[:1].upper() + detail[1:],
        "#robots",
        "See whose",
        alarming=rate.events > 0,
    )


def _software(steps: Sequence[Step]) -> Fact:
    worse = [step for step in steps if step.verdict == "worse"]
    if not steps:
        return Fact(
            "one", "", "Software version or none: nothing to compare.", "#software", "See it"
        )
    if not worse:
        pairs = len({(step.before, step.after) for step in steps})
        detail = f"Software versions that got worse, of {words.count(pairs, 'change')} of version."
        return Fact("none", "", detail, "#software", "See the numbers")
    step = newest(worse)
    return Fact(
        words.share_of(step.now),
        f"of logs {measure_words(step.measure)} with {step.after}; {words.share_of(step.was)} with "
        f"{step.before}",
        f"The difference is {difference(step)}, over {words.count(step.sites, 'site')} and "
        f"{words.count(step.robots, 'robot')}. {_by_chance(steps)}",
        "#software",
        "See the numbers",
        alarming=True,
    )


def _by_chance(steps: Sequence[Step]) -> str:
    """Many changes are looked at, and the one that is told was chosen for being worse."""
    told = {(s.before, s.after) for s in steps if min(s.was.n, s.now.n) >= LEAST_LOGS}
    compared = f"{len(told):,} {'was' if len(told) == 1 else 'were'} compared"
    return f"By chance at most one change of version in forty looks worse; {compared}."


def newest(steps: Sequence[Step]) -> Step:
    """Of the last change of version the one that counts lost logs, if any does."""
    last = [step for step in steps if step.after == steps[-1].after]
    return next((step for step in last if step.measure == "lost"), last[0])


def difference(step: Step) -> str:
    """How far apart two versions are, in points."""
    if step.low is None or step.high is None:
        return "the difference is not known"
    return f"{_points(step.low)} to {_points(step.high)} points with 95 % confidence"


def _points(difference: float) -> str:
    points = 100.0 * difference
    return f"{points:+.1f}" if abs(points) < 9.95 else f"{points:+.0f}"


def measure_words(measure: str) -> str:
    """What a step's measure counts, as in "of logs ..."."""
    from slamreplay.evidence.words import FAILURE_MODES

    told = {"lost": "lost", "changed": "with a changed map", "stopped": "with an unplanned stop",
            "gate": "that the gate failed"}  # fmt: skip
    return told.get(measure, f"with {FAILURE_MODES.get(measure, measure.replace('_', ' '))}")
