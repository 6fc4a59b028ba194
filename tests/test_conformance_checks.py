"""Every check before the conformance kit: sound logs are left alone, the named defect is found."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from audited import healthy
from beliefs import ar1, context

from slamreplay.bundle.belief import belief_times, recorded_belief
from slamreplay.bundle.findings import Finding
from slamreplay.consistency import ABOUT_BELIEF, AUDITS, CHECKS
from slamreplay.consistency.asking import ask
from slamreplay.consistency.context import CheckContext
from slamreplay.testing import ConformanceError, believed, check_check, synthetic_bundle


def torn(seed):
    """A replayed particle filter that held two clusters for a third of the log."""
    sound = believed(seed)
    clusters = 1.0 + (np.arange(len(sound.belief)) % 9 < 3)
    diagnostics = {"updated": np.ones(len(clusters)), "clusters": clusters}
    return replace(sound, subject="amcl", diagnostics=diagnostics)


def unlikely_scans(seed):
    """A particle filter that is surprised by every fifth scan."""
    rng = np.random.default_rng(seed)
    ranks = np.where(rng.random(600) < 0.2, 0, rng.integers(0, 20, 600))
    return replace(believed(seed), diagnostics={"likelihood_quantile": (ranks + 0.5) / 20.0})


def remembered(seed):
    """Innovations that share half of their noise with the one before."""
    context = believed(seed)
    (seen,) = context.innovations
    residual = seen.residual.copy()
    residual[1:] = 0.8 * seen.residual[1:] + 0.6 * seen.residual[:-1]
    return replace(context, innovations=(replace(seen, residual=residual),))


def wrong_in_direction(seed):
    """Twice as far off along one axis as it claims, and half as far along the others."""
    white = ar1(np.random.default_rng(seed), 2000, 0.5 * (seed % 2), 3)
    return context(white * [0.5, 2.0, 0.5])


def jumping(seed):
    """A localizer that goes over to a place a metre away."""
    view = synthetic_bundle(
        seconds=4.0, seed=seed, belief_offset_xyyaw=(1.0, 0, 0), offset_from_s=3.0
    ).view()
    return CheckContext(recorded_belief(view, belief_times(view)), (), view)


#: Of each check about a belief: the finding that names its defect, and a log that has it.
BELIEF_LINES = {
    "belonging": ("SR-CON-011", torn),
    "collapse": ("SR-CON-010", partial(believed, collapsed=0.1)),
    "credibility_index": ("SR-CON-005", wrong_in_direction),
    "distribution": ("SR-CON-004", partial(believed, rows=3000, wild=0.03)),
    "innovation_bias": ("SR-CON-008", partial(believed, bias=0.5)),
    "jumps": ("SR-LOC-005", jumping),
    "nees": ("SR-CON-001", partial(believed, rows=3000, told=0.5)),
    "nis": ("SR-CON-006", partial(believed, told=0.5)),
    "scan_likelihood": ("SR-CON-009", unlikely_scans),
    "whiteness": ("SR-CON-007", remembered),
}


@pytest.mark.parametrize("name", BELIEF_LINES)
def test_belief_check(name):
    id_, defective = BELIEF_LINES[name]
    check_check(CHECKS.load(name), id_, defective)


def test_every_check_about_a_belief_has_its_line():
    assert set(BELIEF_LINES) == ABOUT_BELIEF


def test_all_checks_together_leave_sound_beliefs_alone():
    found = [f for seed in range(200) for f in ask([believed(seed)]) if f.severity != "info"]

    assert len(found) <= 2, found


def test_audits_leave_sound_logs_alone():
    # What each of them finds is held in tests/test_audit_*.py, defect by defect.
    found = []
    for seed in range(200):
        view = healthy(seconds=20.0, seed=seed).view()
        found += [f for f in ask([CheckContext(None, (), view)], AUDITS) if f.severity != "info"]

    assert len(found) <= 2, found


def test_the_kit_notices_a_check_that_cries_wolf_and_one_that_is_blind():
    def wolf(context):
        return (Finding("SR-CON-001", "warning", "wolf"),)

    with pytest.raises(ConformanceError, match="sound logs"):
        check_check(wolf, "SR-CON-001", believed, seeds=5)
    with pytest.raises(ConformanceError, match="0 of 20"):
        check_check(lambda context: (), "SR-CON-001", believed, seeds=5)
    with pytest.raises(ConformanceError, match="something else"):
        check_check(lambda context: ("odd",), "SR-CON-001", believed, seeds=5)
