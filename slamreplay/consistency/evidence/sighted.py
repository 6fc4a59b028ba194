"""A belief against tags and docks that stand still: surveyed ones, and those it saw again."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.sightings import KINDS, Sightings, sightings_of
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.consistency.evidence.carried import Carried, carried
from slamreplay.consistency.evidence.source import MAP_AXES, Evidence
from slamreplay.consistency.evidence.standing_still import against_the_past, things, visits
from slamreplay.geometry import se2
from slamreplay.geometry.transforms import clean_frame

#: An update is held against a sighting no farther from it in time than this.
WITHIN_S = 0.5
#: Sightings under one name that a belief puts farther apart than this are of two things.
ONE_THING_M = 2.0
#: A belief is made of sightings if this share of its updates bears their very stamps, and puts what
#: was seen then so exactly where it always puts it: two measurements never agree like that.
_SAME_STAMPS, _EXACT_M, _LEAST = 0.5, 2e-3, 3
#: So many names are spelt out.
_NAMES = 3

_USUAL = "the noise of a sighting was taken at its usual most"
_CANCELS = "what is always wrong in a belief cancels between two visits, as does a constant offset"


def sighted(updates: PoseTrack, view: BundleView, motion: PoseTrack | None) -> tuple[Evidence, ...]:
    """Errors of a belief's updates (N rows) against what the robot sensed and stands still.

    Surveyed things: where a sighting, carried by the belief, puts the thing, minus its survey; the
    heading counts where it is both sensed and surveyed. Other things: where the belief puts them at
    one visit, minus where it put them at the visits before.
    """
    seen = sightings_of(view, updates if motion is None else motion)
    if seen is None:
        return ()
    in_map = clean_frame(updates.frame_id) == (view.manifest.frames.map or "map")
    found: list[Evidence] = []
    for kind in KINDS:
        rows = np.flatnonzero(seen.kind == kind)
        if not len(rows):
            continue
        at = carried(
            updates, motion, seen.t_ns[rows], seen.name[rows], seen.xyyaw[rows], seen.cov[rows],
            WITHIN_S,
        )  # fmt: skip
        at = Carried(at.update, rows[at.sensed], at.places, at.cov)
        if _is_made_of(updates, seen, at):
            why = "its updates bear their very stamps and agree with them to the millimetre"
            found.append(Evidence.refused(f"sightings of {kind}s", kind, why))
            continue
        found += _surveyed(kind, updates.t_ns, seen, at) if in_map else []
        found += _again(kind, updates.t_ns, seen, at)
    return tuple(found)


def _is_made_of(updates: PoseTrack, seen: Sightings, at: Carried) -> bool:
    """Whether a belief was computed from the sightings that it would be held against."""
    same = at.take(updates.t_ns[at.update] == seen.t_ns[at.sensed])
    apart = np.full(len(same.update), np.inf)
    for name in sorted(set(seen.name[same.sensed])):
        rows = np.flatnonzero(seen.name[same.sensed] == name)
        if len(rows) >= _LEAST:
            xy = same.places[rows, :2]
            apart[rows] = np.hypot(*(xy - np.median(xy, axis=0)).T)
    nearest = np.full(len(updates), np.inf)  # of several things it may be made of one alone
    np.minimum.at(nearest, same.update, apart)
    return bool((nearest <= _EXACT_M).mean() >= _SAME_STAMPS)


def _surveyed(kind: str, t_ns: NDArray[np.int64], seen: Sightings, at: Carried) -> list[Evidence]:
    """Things with a surveyed heading, and those of which only the place is."""
    from slamreplay.graph.sightings import SURVEY  # it loads gtsam

    found = []
    for dof in (3, 2):
        parts, names = [], []
        for name, survey in sorted(seen.surveyed.items()):
            rows = np.flatnonzero(seen.name[at.sensed] == name)
            if (3 if np.isfinite(survey[2]) else 2) != dof or not len(rows):
                continue
            error = (at.places[rows] - survey)[:, :dof]
            error[:, 2:] = se2.wrap_angle(error[:, 2:])
            prior = np.diag(SURVEY[:dof] ** 2)
            parts.append((t_ns[at.update[rows]],
                          *against_the_past(error, at.cov[rows, :dof, :dof], prior)))  # fmt: skip
            names.append(name)
        found += _evidence(f"surveyed {kind}s {_listed(names)}", kind, parts, _USUAL)
    return found


def _again(kind: str, t_ns: NDArray[np.int64], seen: Sightings, at: Carried) -> list[Evidence]:
    parts, names = [], []
    for name in sorted(set(seen.name[at.sensed]) - set(seen.surveyed)):
        rows = np.flatnonzero(seen.name[at.sensed] == name)
        rows = rows[visits(t_ns[at.update[rows]])]
        which = things(at.places[rows], ONE_THING_M, np.inf)
        for thing in range(which.max() + 1):
            own = rows[which == thing]
            if len(own) > 1:
                places = (at.places[own] - at.places[own[0]])[:, :2]
                parts.append((t_ns[at.update[own[1:]]],
                              *against_the_past(places, at.cov[own, :2, :2], None)))  # fmt: skip
                names.append(name)
    return _evidence(f"{kind}s seen again, {_listed(names)}", kind, parts, _CANCELS)


def _evidence(
    source: str,
    kind: str,
    parts: Sequence[tuple[NDArray[np.int64], se2.Array, se2.Array]],
    at_most: str,
) -> list[Evidence]:
    """One piece of evidence of all things, in order of time; none without a row."""
    if not parts:
        return []
    t_ns, error, cov = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    order = np.argsort(t_ns, kind="stable")
    axes = MAP_AXES[: error.shape[1]]
    return [Evidence(source, kind, t_ns[order], error[order], cov[order], axes, at_most)]


def _listed(names: Sequence[str]) -> str:
    """Names without their kind, the first ones spelt out."""
    short = list(dict.fromkeys(name.partition(" ")[2] for name in names))
    more = len(short) - _NAMES
    return ", ".join(short[:_NAMES]) + (f" and {more} more" if more > 0 else "")
