"""One drive in worlds that differ in one thing: what is changed, and how partings are counted."""

import numpy as np
import pytest
from scipy.stats import mannwhitneyu

from slamreplay.labs.lost_or_changed.drive import (
    BOXES,
    DIFFERENCES,
    healthy,
    with_one_difference,
)
from slamreplay.labs.lost_or_changed.pages import results
from slamreplay.labs.lost_or_changed.parting import parting
from slamreplay.labs.lost_or_changed.trials import Trial
from slamreplay.simulate.drive import drive
from slamreplay.simulate.routes import Floor


def made_up(what="slip_s", level=1.0, log=1, state="lost", true="lost", seed=0, **lost_changed):
    """A log of a minute; `lost` and `changed` are shares of it, from its start and its end."""
    rng = np.random.default_rng(seed)
    n = 600
    lost = np.arange(n) < n * lost_changed.get("lost", 0.0)
    changed = np.arange(n) >= n * (1.0 - lost_changed.get("changed", 0.0))
    measures = {
        "sigma_m": rng.uniform(0.4, 0.7, n),
        "beams_off": rng.uniform(0.0, 0.9, n) + 0.1 * lost,
        "error_m": np.where(lost, 2.0, 0.1) + rng.uniform(0.0, 0.1, n),
        "changed_share": np.where(changed, 0.3, 0.0) + rng.uniform(0.0, 0.01, n),
    }
    return Trial(what, level, log, state, true, measures, lost, changed, 0.0, 0.0)


@pytest.mark.parametrize("what", DIFFERENCES)
def test_a_world_differs_in_one_thing(what):
    story, base = with_one_difference(healthy(), what, 1.0, seed=3), healthy()
    differs = {
        name
        for name in ("standing", "tour", "believed_start", "mapped", "start", "wheels", "lidar")
        if getattr(story, name) != getattr(base, name)
    }

    assert len(differs) == (2 if what == "boxes_and_wrong_start" else 1)
    assert story.mapped == base.mapped


def test_more_boxes_are_the_same_boxes_and_more():
    few, many = (
        set(with_one_difference(healthy(), "boxes", n, seed=3).standing.solids) for n in (4, 9)
    )

    assert few < many


@pytest.mark.parametrize(("what", "level"), [("boxes", BOXES), ("racks_moved_m", 0.7)])
def test_what_is_put_down_is_beside_the_way(what, level):
    way = drive(healthy().start, healthy().tour).xyyaw[:, :2]
    for seed in range(5):
        standing = with_one_difference(healthy(), what, level, seed).standing
        assert Floor.of(standing).at(way).min() > 0.4


def test_areas_are_those_of_mann_and_whitney():
    logs = [made_up(lost=0.4, changed=0.3, seed=k) for k in range(4)]
    values, lost = [], []
    for one in logs:
        rows = np.flatnonzero(one.lost ^ one.changed)[::5]
        values.append(one.measures["beams_off"][rows])
        lost.append(one.lost[rows])
    v, is_lost = np.concatenate(values), np.concatenate(lost)
    u = mannwhitneyu(v[is_lost], v[~is_lost]).statistic

    area, low, high = parting(logs, "beams_off")

    assert area == pytest.approx(u / (is_lost.sum() * (~is_lost).sum()), abs=1e-12)
    assert low < area < high
    assert parting(logs, "error_m") == [1.0, 1.0, 1.0]
    assert parting(logs, "changed_share", low_is_lost=True) == [1.0, 1.0, 1.0]
    assert parting([made_up(lost=0.4)], "error_m") == [None, None, None]


def test_a_flip_lies_between_the_last_level_without_and_the_first_with():
    logs = [made_up("", 0.0, log, "healthy", "healthy") for log in (1, 2)]
    for log, first in ((1, 1.0), (2, 2.0)):
        for level in (0.5, 1.0, 2.0):
            state = "lost" if level >= first else "healthy"
            logs.append(made_up("slip_s", level, log, state, "healthy", lost=0.2, changed=0.2))

    flips = results(logs).numbers["flips"]["slip_s"]

    assert flips["lost"] == {"verdict": [0.5, 2.0, 2], "truth": [None, None, 0]}
    assert flips["map_changed"]["verdict"] == [None, None, 0]


def test_what_is_held_is_exceeded_for_five_seconds():
    one = made_up(lost=0.2)
    values = one.measures["error_m"]

    assert np.sum(values >= one.held("error_m")) == 50
