"""What the belief's covariance was worth, in numbers."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from slamreplay.consistency.evidence.parts import HEADING, POSE, POSITION
from slamreplay.consistency.statistics.mean_test import N_EFF_MIN, MeanTest
from slamreplay.evidence.result import Postmortem
from slamreplay.gate.measures import Answer, Measure, Series

_OF_NEES = ("nees_mean", "nees_factor", "nees_interval_ratio")


def covariance_numbers(post: Postmortem, sigma: Series | None) -> Iterator[tuple[str, Answer]]:
    """NEES against the best reference, and sigma.

    Below 20 effective samples a NEES is missing: the report calls it insufficient.

    Args:
        post: the post-mortem.
        sigma: of position over time; None where the belief has no covariance.
    """
    if sigma is None:
        why = _lack(post)
        yield from (("sigma_max_m", why), ("sigma_median_m", why))
    else:
        known = sigma.values[np.isfinite(sigma.values)]
        yield "sigma_max_m", Measure(float(known.max()), "m")
        yield "sigma_median_m", Measure(float(np.median(known)), "m")
    tests: dict[str, MeanTest | str] = {}
    for part in (POSE, POSITION, HEADING):
        if post.nees is None:
            tests[part.name] = _lack(post)
        else:
            test = post.nees.summary(part).test
            tests[part.name] = test if test.sufficient and test.mean else _few(post, test)
    pose = tests[POSE.name]
    whole = tests[POSITION.name] if isinstance(pose, str) else pose
    if isinstance(whole, str):
        yield from ((name, whole) for name in _OF_NEES)
    else:
        yield "nees_mean", mean_nees(whole)
        yield "nees_factor", factor(whole)
        assert whole.mean is not None
        assert whole.high is not None
        yield "nees_interval_ratio", Measure(whole.mean / whole.high, "", n_eff=whole.n_eff)
    for part in (POSITION, HEADING):
        test_ = tests[part.name]
        yield f"nees_factor_{part.name}", test_ if isinstance(test_, str) else factor(test_)


def mean_nees(test: MeanTest) -> Measure:
    """The mean with its interval.

    The ends of the test's interval hold the mean of consistent errors, of which `dof` is expected.
    If sigma is off by one factor all along, means scale with its square, and the expectation lies
    within dof mean / high to dof mean / low with the same probability.
    """
    mean, low, high = test.mean, test.low, test.high
    assert mean is not None
    assert low is not None
    assert high is not None
    upper = test.dof * mean / low if low > 0.0 else None
    return Measure(mean, "", test.dof * mean / high, upper, test.n_eff)


def factor(test: MeanTest) -> Measure:
    """By which sigma is too small, with the interval of the mean NEES."""
    mean = mean_nees(test)
    low, high = (None if v is None else math.sqrt(v / test.dof) for v in (mean.low, mean.high))
    return Measure(math.sqrt(mean.value / test.dof), "", low, high, test.n_eff)


def _few(post: Postmortem, test: MeanTest) -> str:
    if post.nees is not None and post.nees.refusal is not None:
        return post.nees.refusal
    if not test.n:
        return "no update of the belief has an error and a covariance"
    return f"{test.n} updates are worth {test.n_eff:.0f} independent ones, {N_EFF_MIN} are needed"


def _lack(post: Postmortem) -> str:
    if post.belief is None or not post.belief.has_pose.any():
        return "no localizer spoke"
    if not np.isfinite(post.belief.cov[:, :2, :2]).all(axis=(1, 2)).any():
        return "no covariance of the belief that could be used"
    return "no reference to measure the belief's errors against"
