"""The drive that both runs replay: out of one of two equal bays, and into the other."""

from __future__ import annotations

import numpy as np

from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.tables import Table
from slamreplay.bundle.view import BundleView
from slamreplay.simulate.alike import BAY_LENGTH_M, BAY_PITCH_M, twin_bays
from slamreplay.simulate.bundled import bundle_of
from slamreplay.simulate.drive import Follow, Pause, Step
from slamreplay.simulate.recording import Recording, record
from slamreplay.simulate.scenarios import Scenario

#: A rest ends each leg, so that the next one is an action of its own.
_REST_S = 1.2
_LEGS_X_M = (4.0, 6.0, 8.0, 10.0, 12.0, 14.0, 16.2, 18.3)
_MIDDLE_M = 2.6


def drive_out(seed: int) -> Recording:
    """A log of about 70 s: along a bay, through the passage, into the other bay.

    Logs start in the lower and in the upper bay by turns, within a metre of the same place.
    """
    hall = twin_bays()
    rng = np.random.default_rng([seed, 0])
    here = _MIDDLE_M + (seed % 2) * BAY_PITCH_M
    there = _MIDDLE_M + (1 - seed % 2) * BAY_PITCH_M
    goals = [*((x, here) for x in _LEGS_X_M), (_LEGS_X_M[-1], there), (BAY_LENGTH_M - 1.0, there)]
    tour: list[Step] = [Pause(_REST_S)]
    for goal in goals:
        tour += [Follow((goal,)), Pause(_REST_S)]
    start = (1.7 + float(rng.uniform(0.0, 1.0)), here + float(rng.uniform(-0.2, 0.2)), 0.0)
    return record(Scenario(hall, hall, start, tuple(tour), "healthy", seed))


def evidence_of(recording: Recording) -> BundleView:
    """The log without its plans, which were made from another belief than the one under test."""
    return bundle_of(recording).view().with_table(Table.empty(TABLES["plans"]))
