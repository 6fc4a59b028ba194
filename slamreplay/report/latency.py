"""How old the pose was when it was used: the page's table and words, and report.json's part."""

from __future__ import annotations

import numpy as np

from slamreplay.evidence.result import Postmortem
from slamreplay.report.cells import Cell, Table, table
from slamreplay.report.model import AgePart, LatencyPart, UsagePart
from slamreplay.report.phrases import NOT_KNOWN, number, percent
from slamreplay.verdict.latency.latency import Usage
from slamreplay.verdict.latency.spread import Spread

_HEAD = (
    "who used it", "rate", "budget", "age of the pose", "95 of 100 below", "oldest",
    "over budget", "age of the correction", "moved meanwhile",
)  # fmt: skip


def usage_table(post: Postmortem) -> Table:
    """A row for each consumer of the pose."""
    return table(_HEAD, [_row(usage) for usage in post.usages])


def latency_note(post: Postmortem) -> str:
    """What the ages are made of and rest on; empty where there are none."""
    if post.latency is None or not post.usages:
        return ""
    first = (
        "Age of the pose: from the moment that tf could answer for until it was used; odometry "
        "carries the localizer's last correction on to there. To be over the budget is no fault "
        "while the robot hardly moves in that time."
    )
    text = [first]
    told = [u for u in post.usages if u.correction.p50 is not None]
    said = post.latency.said
    if said is None:
        text.append("No localizer corrected odometry, so that only odometry has an age.")
    elif told:
        if not said.on_tf and post.latency.odometry is not None:
            text.append("Its corrections are not on tf: odometry is taken to carry its poses.")
        text.append(_parts(told[0], said.dated, said.lead_s))
    return " ".join([*text, *(f"{c[0].upper()}{c[1:]}." for c in post.latency.clocks.caveats)])


def latency_part(post: Postmortem) -> LatencyPart | None:
    """The key `latency` of report.json."""
    if post.latency is None:
        return None
    said = post.latency.said
    return LatencyPart(
        basis=post.latency.clocks.basis,
        caveats=list(post.latency.clocks.caveats),
        localizer=None if said is None else said.source,
        dated=None if said is None else said.dated,
        ahead_s=None if said is None else said.lead_s,
        consumers=[usage_part(usage) for usage in post.usages],
    )


def _row(usage: Usage) -> tuple[str | Cell, ...]:
    user, loop = usage.ages.consumer, usage.ages.consumer.loop
    rate = NOT_KNOWN if loop is None else f"{1.0 / loop.period_s:.1f} Hz"
    over = Cell(NOT_KNOWN)
    if usage.over is not None:
        over = Cell(percent(usage.over[0]), f"of {usage.pose.n}")
    turned = usage.unknown_rad.p95
    return (
        Cell(user.name, user.topic or "not recorded: as if at the budget's rate"),
        Cell(rate, "" if loop is None else f"longest pause {_ms(loop.stall_s)}"),
        Cell(f"{user.budget_hz:g} Hz", _ms(user.budget_s)),
        _ms(usage.pose.p50),
        Cell(_ms(usage.pose.p95), _interval(usage.pose)),
        _ms(usage.pose.most),
        over,
        Cell(_ms(usage.correction.p50), f"95 of 100 below {_ms(usage.correction.p95)}"),
        Cell(
            number(usage.unknown_m.p95, ".3f", "m"),
            f"turned {number(None if turned is None else np.degrees(turned), '.1f', 'deg')}; "
            "95 of 100 below",
        ),
    )


def _parts(usage: Usage, dated: str, ahead_s: float) -> str:
    """Where the time of the correction goes."""
    if dated == "scan" and usage.sensing_s is not None:
        text = (
            f"The {usage.ages.consumer.name}'s correction, in the median: {_ms(usage.sensing_s)} "
            f"until its scan was there, {_ms(usage.answering_s)} for the answer, "
            f"{_ms(usage.waiting_s)} until it was used"
        )
    elif dated == "stamp":
        text = "The correction's age counts from its own stamp, which may be of its publication"
    else:
        text = "The correction's age counts from its arrival: what it was measured from is not told"
    ahead = f"; it is dated {_ms(ahead_s)} ahead, which makes it no younger" if ahead_s else ""
    return f"{text}{ahead}."


def _interval(spread: Spread) -> str:
    if spread.p95_low is None:
        return "too few for an interval"
    return f"95 %: {_ms(spread.p95_low)} to {_ms(spread.p95_high)}"


def _ms(seconds: float | None) -> str:
    return number(None if seconds is None else 1e3 * seconds, ".0f", "ms")


def usage_part(usage: Usage) -> UsagePart:
    """One consumer, as report.json has it."""
    user, over = usage.ages.consumer, usage.over
    return UsagePart(
        name=user.name,
        topic=user.topic,
        uses=len(user.t_ns),
        rate_hz=None if user.loop is None else 1.0 / user.loop.period_s,
        longest_pause_s=None if user.loop is None else user.loop.stall_s,
        work_s=user.work_s,
        budget_hz=user.budget_hz,
        budget_s=user.budget_s,
        over_share=None if over is None else over[0],
        over_low=None if over is None else over[1],
        over_high=None if over is None else over[2],
        pose_s=_age(usage.pose),
        correction_s=_age(usage.correction),
        update_s=_age(usage.update),
        sensing_s=usage.sensing_s,
        answering_s=usage.answering_s,
        waiting_s=usage.waiting_s,
        unknown_m=_age(usage.unknown_m),
        unknown_rad=_age(usage.unknown_rad),
    )


def _age(spread: Spread) -> AgePart:
    return AgePart(
        p50=spread.p50, p95=spread.p95, max=spread.most, p95_low=spread.p95_low,
        p95_high=spread.p95_high, n=spread.n, n_eff=spread.n_eff,
    )  # fmt: skip
