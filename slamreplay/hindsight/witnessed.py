"""Places of submaps that also agree on what the robot saw twice: tags and docks stand still.

A thing at a known place speaks for or against each hypothesis alone. One at an unknown place ties
all submaps that saw it; given its place the submaps are a chain again, so places of the thing are
tried one by one (conditioning on a cutset; Pearl 1988, section 4.4.1), one thing after the other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from slamreplay.geometry import se2
from slamreplay.hindsight.chain import Chain
from slamreplay.hindsight.places import WEIGHT, Hypotheses, Places, best_different, best_places
from slamreplay.hindsight.sensed import Sensed
from slamreplay.hindsight.submaps import Submap, owners

#: How far a sighting may miss before it counts: what camera, hypothesis and chain leave together.
SIGMA = np.array([0.3, 0.3, 0.2])
#: The most that one sighting can speak against a place: things are moved, and two share a name.
MOST = 12.0
#: Below this log-likelihood nothing is to be gained from another place of a thing.
_AGREES = 1.0
#: Places of a thing that are tried.
_TRIED = 8

#: Of each submap the things it saw and where, seen from its reference keyframe.
Views = list[dict[int, se2.Array]]


def witnessed_places(
    hypotheses: Sequence[Hypotheses],
    motions: se2.Array,
    jump_cost: se2.Array,
    chain: Chain,
    found: Sequence[Submap],
    sensed: Sensed | None,
) -> Places:
    """The most probable sequence of hypotheses, the things seen on the way included.

    Args:
        hypotheses: of the S submaps.
        motions: (S - 1, 3) measured motion between their references.
        jump_cost: (S - 1,) what it costs to believe otherwise.
        chain: the keyframes.
        found: the submaps.
        sensed: what was seen; None is nothing.
    """
    plain = best_places(hypotheses, motions, jump_cost)
    if sensed is None or not len(sensed.key):
        return plain
    views = _views(sensed, chain, found)
    known = {j: p for j, p in enumerate(sensed.surveyed) if np.isfinite(p[:2]).all()}
    things = sorted(
        j for j in range(len(sensed.names)) if j not in known and sum(j in v for v in views) > 1
    )
    surveyed = _told(hypotheses, views, known)
    best = best_places(surveyed, motions, jump_cost) if known else plain
    at: dict[int, se2.Array] = {}
    for j in things:
        place, cost = _agreed(views, best, j)
        if cost < _AGREES:
            at[j] = place
            continue
        for candidate in _candidates(hypotheses, views, j):
            tried = {**at, j: candidate}
            other = best_places(_told(surveyed, views, tried), motions, jump_cost)
            if other.total > best.total - cost:
                best, place, cost = other, candidate, 0.0
        at[j] = place
        best = replace(best, total=best.total - cost)
    if not known and np.array_equal(best.chosen, plain.chosen):
        return plain
    score = np.array([h.score[i] for h, i in zip(hypotheses, best.chosen, strict=True)])
    # What moves along with another sequence tells nothing against it: of things at unknown places
    # the margin counts none.
    other_total = best_different(surveyed, motions, jump_cost, best.xyyaw)
    margin = None
    if other_total is not None:
        own = best.total + sum(
            _cost(pose[None], views[s], at)[0] for s, pose in enumerate(best.xyyaw)
        )
        margin = float((own - other_total) / (WEIGHT * len(hypotheses)))
    return replace(best, score=score, margin=margin)


def _views(sensed: Sensed, chain: Chain, found: Sequence[Submap]) -> Views:
    owner = owners(found, len(chain.xyyaw))
    views: Views = [{} for _ in found]
    reference = np.array([s.reference for s in found])
    for m in np.argsort(np.abs(sensed.key - reference[owner[sensed.key]]), kind="stable").tolist():
        s, j = int(owner[sensed.key[m]]), int(sensed.name[m])
        if s >= 0 and j not in views[s]:
            step = se2.between(chain.xyyaw[reference[s]], chain.xyyaw[sensed.key[m]])
            views[s][j] = se2.compose(step, sensed.xyyaw[m])
    return views


def _cost(
    poses: se2.Array, view: Mapping[int, se2.Array], at: Mapping[int, se2.Array]
) -> se2.Array:
    """(H,) how much the things at known places speak against a submap's poses (H, 3)."""
    total = np.zeros(len(poses))
    for j in sorted(view.keys() & at.keys()):
        total += _miss(se2.compose(poses, view[j]), at[j])
    return total


def _miss(seen: se2.Array, at: se2.Array) -> se2.Array:
    step = seen - at
    # What was seen as a point has no heading to miss.
    step[..., 2] = np.nan_to_num(se2.wrap_angle(step[..., 2]), nan=0.0)
    return np.asarray(np.minimum(0.5 * ((step / SIGMA) ** 2).sum(axis=-1), MOST))


def _told(
    hypotheses: Sequence[Hypotheses], views: Views, at: Mapping[int, se2.Array]
) -> list[Hypotheses]:
    """The hypotheses with scores that count what things at these places say."""
    return [
        Hypotheses(h.xyyaw, (h.log_likelihood - _cost(h.xyyaw, view, at)) / WEIGHT)
        for h, view in zip(hypotheses, views, strict=True)
    ]


def _agreed(views: Views, places: Places, j: int) -> tuple[se2.Array, float]:
    """The place of a thing that those who saw it agree on best, and what it still costs."""
    seen = np.array([se2.compose(places.xyyaw[s], v[j]) for s, v in enumerate(views) if j in v])
    costs = np.array([_miss(seen, place).sum() for place in seen])
    return seen[int(np.argmin(costs))], float(costs.min())


def _candidates(hypotheses: Sequence[Hypotheses], views: Views, j: int) -> list[se2.Array]:
    """Places of a thing that would suit the submaps that saw it, taken one by one, best first."""
    seeing = [s for s, view in enumerate(views) if j in view]
    seen = [se2.compose(hypotheses[s].xyyaw, views[s][j]) for s in seeing]
    places = np.concatenate(seen)
    worth = np.zeros(len(places))
    for s, others in zip(seeing, seen, strict=True):
        apart = _miss(others[None, :, :].repeat(len(places), axis=0), places[:, None, :])
        worth += (hypotheses[s].log_likelihood[None, :] - apart).max(axis=1)
    kept: list[se2.Array] = []
    for place in places[np.argsort(-worth, kind="stable")]:
        if all(_miss(place, other) > _AGREES for other in kept):
            kept.append(place)
        if len(kept) == _TRIED:
            break
    return kept
