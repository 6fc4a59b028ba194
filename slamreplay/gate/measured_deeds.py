"""What the robot did with its belief, in numbers: stops, recoveries, risks, jumps, ages."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from slamreplay.estimators import RECORDED
from slamreplay.evidence.result import Postmortem
from slamreplay.gate.measures import Answer, Measure
from slamreplay.verdict.judgement import Action
from slamreplay.verdict.latency.spread import Spread


def deed_numbers(post: Postmortem) -> Iterator[tuple[str, Answer]]:
    """Counts of what was done, and the ages of the poses that it was done by."""
    moves = post.odometry is not None or post.belief is not None or post.hindsight is not None
    still = "nothing in the log tells how the robot moved"
    yield "stops", _count(len(post.judgement.stops)) if moves else still
    recoveries = [a for a in post.judgement.actions if a.kind == "recovery"]
    recorded = post.manifest.topic_of("recovery") is not None
    if recorded or recoveries:
        yield "recoveries", _count(len(recoveries))
    else:
        yield "recoveries", "recoveries were not recorded"
    yield "needless_recoveries", _needless(recoveries, recorded=recorded)
    # Motions stand for themselves: the recoveries that are inferred from them would count twice.
    told = [a for a in post.judgement.actions if not a.inferred]
    weighed = [a.allowed for a in told if a.allowed is not None]
    yield (
        "risky_actions",
        (_count(weighed.count(False)) if weighed else "of no action the room it had is known"),
    )
    yield from _jumps(post)
    yield "pose_age_p95_s", _oldest(post, [u.pose for u in post.usages])
    yield "correction_age_p95_s", _oldest(post, [u.correction for u in post.usages])


def _needless(recoveries: Sequence[Action], *, recorded: bool) -> Answer:
    if not recorded:
        return "recoveries were not recorded"
    told = [a.needless for a in recoveries if not a.inferred]
    if told and all(n is None for n in told):
        return "whether its recoveries were needed could not be judged"
    return _count(told.count(True))


def _jumps(post: Postmortem) -> Iterator[tuple[str, Answer]]:
    """Of the recorded localizer, the steps that nobody asked for by setting the pose."""
    told = [jumps for trial, jumps in post.jumps if trial.estimator in RECORDED]
    if not told or post.odometry is None:
        why = "no localizer spoke" if not told else "no odometry to tell a jump from driving"
        yield from (("jumps", why), ("jump_max_m", why))
        return
    # A localizer may have spoken on tf and as a topic: one of the two is as it was.
    own = max(([j for j in jumps if not j.is_given] for jumps in told), key=len)
    yield "jumps", _count(len(own))
    yield "jump_max_m", Measure(max((float(j.step.metres) for j in own), default=0.0), "m")


def _oldest(post: Postmortem, spreads: Sequence[Spread]) -> Answer:
    """The worst consumer's 95th percentile.

    Where clocks tell ages from the fastest message only, they are longer than told: none is given,
    for a limit would be passed that does not hold.
    """
    if post.latency is not None and post.latency.clocks.basis != "shared":
        return "stamps and log times are not of one clock: ages are longer than the log tells"
    known = [s for s in spreads if s.p95 is not None]
    if not known:
        return "no use of a pose that has an age was recorded"
    worst = max(known, key=lambda s: s.p95 or 0.0)
    assert worst.p95 is not None
    return Measure(worst.p95, "s", worst.p95_low, worst.p95_high, worst.n_eff)


def _count(number: int) -> Measure:
    return Measure(float(number), "")
