"""Tags, docks and satellite fixes: which of them made hindsight, and what the others say of it."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from slamreplay.bundle.findings import Finding
from slamreplay.bundle.fixes import satellite_fixes
from slamreplay.bundle.products import Hindsight
from slamreplay.bundle.schema import SENSED_KINDS
from slamreplay.bundle.sightings import sightings_of
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import Bundle
from slamreplay.geometry import se2
from slamreplay.geometry.alignment import aligned

#: Fewer sightings of a thing, or fixes, show nothing.
_LEAST = 3


def sensed_references(
    bundle: Bundle, hindsight: Hindsight | None, hold_out: Collection[str]
) -> tuple[Finding, ...]:
    """SR-REF-001 for each kind that was free to join hindsight, SR-REF-002 for each held out.

    Args:
        bundle: the log.
        hindsight: made without the kinds that are held out.
        hold_out: kinds of `SENSED_KINDS`.
    """
    if hindsight is None or not hindsight.track.has_pose.any():
        return ()
    kinds, counts = np.unique(bundle.table("references")["kind"].astype(str), return_counts=True)
    found = []
    for kind, count in zip(kinds.tolist(), counts.tolist(), strict=True):
        if kind in hold_out:
            found.append(_judged(bundle, hindsight.track, kind))
        elif kind in SENSED_KINDS:
            used = hindsight.joined.get(kind, 0)
            text = f"{used} of {count} {_name(kind)} joined hindsight, at most one per keyframe"
            if not used:
                text = f"{count} {_name(kind)} did not join hindsight: where the sensor sits on "
                text += "the robot is not known, or no keyframe is near"
            found.append(Finding("SR-REF-001", "info", text, n=used))
    return tuple(found)


def _judged(bundle: Bundle, track: PoseTrack, kind: str) -> Finding:
    apart = _fixes_apart(bundle, track) if kind == "gnss" else _things_apart(bundle, track, kind)
    if not len(apart):
        text = f"the {_name(kind)} that were held out cannot be tied to hindsight"
        return Finding("SR-REF-002", "info", text, n=0)
    middle, most = float(np.median(apart)), float(np.percentile(apart, 95))
    where = "the place of what they saw" if kind != "gnss" else "hindsight, rigidly aligned"
    text = f"{len(apart)} {_name(kind)} that were held out lie {middle:.3f} m (median; 95 % within "
    text += f"{most:.3f} m) from {where}"
    return Finding(
        "SR-REF-002", "info", text, value=middle, high=most, unit="m", n=len(apart),
        start_ns=int(track.t_ns[0]), end_ns=int(track.t_ns[-1]),
    )  # fmt: skip


def _things_apart(bundle: Bundle, track: PoseTrack, kind: str) -> se2.Array:
    """(M,) of each sighting, carried by hindsight, to the thing's surveyed or median place."""
    seen = sightings_of(bundle.view(), track)
    if seen is None:
        return np.empty(0)
    placed = se2.compose(track.at(seen.t_ns).xyyaw, seen.xyyaw)[:, :2]
    use = (seen.kind == kind) & np.isfinite(placed).all(axis=1)
    apart = []
    for name in sorted(set(seen.name[use])):
        at = placed[use & (seen.name == name)]
        if name in seen.surveyed:
            apart.append(np.hypot(*(at - seen.surveyed[name][:2]).T))
        elif len(at) >= _LEAST:
            apart.append(np.hypot(*(at - np.median(at, axis=0)).T))
    return np.concatenate([np.empty(0), *apart])


def _fixes_apart(bundle: Bundle, track: PoseTrack) -> se2.Array:
    """(M,) of each fix to the antenna where hindsight has it."""
    fixes = satellite_fixes(bundle.view())
    if fixes is None:
        return np.empty(0)
    poses = track.at(fixes.t_ns).xyyaw
    use = np.isfinite(poses).all(axis=1)
    if use.sum() < _LEAST:
        return np.empty(0)
    antenna = se2.transform_points(poses[use], fixes.antenna_xy[None])[:, 0]
    motion = aligned(fixes.xy[use], antenna)
    return np.asarray(np.hypot(*(se2.transform_points(motion, fixes.xy[use]) - antenna).T))


def _name(kind: str) -> str:
    return "satellite fixes" if kind == "gnss" else f"sightings of {kind}s"
