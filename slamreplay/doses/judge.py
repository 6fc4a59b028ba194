"""What errors are measured against: the best judge that speaks of an estimator's own frame."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np

from slamreplay.bundle.atomic import write_file
from slamreplay.bundle.code_hash import code_hash
from slamreplay.bundle.run import Estimate, Run, Trial, read_run, run_bytes
from slamreplay.bundle.schema import JUDGING_KINDS
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import Bundle
from slamreplay.consistency.evidence.references import references_of
from slamreplay.consistency.evidence.source import Reference
from slamreplay.errors import BundleError, OutputError
from slamreplay.geometry.transforms import clean_frame
from slamreplay.hindsight.pipeline import hindsight

#: A judge that knows less than this share of a run's rows is none of the run.
_LEAST_SHARE = 0.5
#: What judges a run that nothing else can be held against.
BASELINE = "baseline"
#: Packages whose code hindsight depends on.
_CODE = ("geometry", "maps", "matching", "graph", "bundle", "hindsight")

Progress = Callable[[str, float], None]


class Judges:
    """The judges of one log, the best first; hindsight is made when the first run needs it.

    Args:
        bundle: the log, undisturbed: it judges every trial on it.
        cache: folder in which hindsight is kept; None keeps it nowhere.
        progress: told what hindsight is doing.
    """

    def __init__(
        self, bundle: Bundle, cache: Path | None = None, progress: Progress | None = None
    ) -> None:
        self._bundle, self._cache, self._progress = bundle, cache, progress
        found = references_of(bundle, None)
        self._recorded = [r for r in found if r.kind in JUDGING_KINDS]
        self._hindsight: list[Reference] | None = None

    def of(self, track: PoseTrack) -> Reference | None:
        """Who judges an estimator, by its undisturbed track; None is that track itself.

        Nothing is aligned: a reference in another frame judges nobody.
        """
        best = _first_that_speaks(self._recorded, track)
        if best is not None or not _is_in(track, self._bundle.manifest.frames.map or "map"):
            return best
        if self._hindsight is None:
            made = looked_back(self._bundle, self._cache, self._progress)
            self._hindsight = [] if made is None else [Reference("hindsight", "hindsight", made)]
        return _first_that_speaks(self._hindsight, track)


def _first_that_speaks(references: Sequence[Reference], track: PoseTrack) -> Reference | None:
    posed = track.take(track.has_pose)
    for reference in references:
        if not _is_in(track, reference.track.frame_id) or not len(posed):
            continue
        there = np.isfinite(reference.track.at(posed.t_ns).xyyaw[:, :2]).all(axis=1)
        if there.mean() >= _LEAST_SHARE:
            return reference
    return None


def _is_in(track: PoseTrack, frame_id: str) -> bool:
    return clean_frame(track.frame_id) == clean_frame(frame_id)


def looked_back(
    bundle: Bundle, cache: Path | None, progress: Progress | None = None
) -> PoseTrack | None:
    """Where the robot was by hindsight of the undisturbed log; None where that cannot be rebuilt.

    Args:
        bundle: the log.
        cache: folder in which the track is kept from one design to the next.
        progress: told the step and its share done.
    """
    trial = Trial(bundle.manifest.bundle_id, "hindsight", 0)
    file = None
    if cache is not None and bundle.path is not None:
        key = hashlib.sha256(
            f"{trial.record}\0{code_hash(*_CODE)}\0{np.__version__}".encode()
        ).hexdigest()
        file = cache / f"{key}.npz"
        with suppress(BundleError):  # not there, damaged, or of an older version
            kept = read_run(file).estimate
            return None if kept is None else kept.track
    found = hindsight(bundle.view(), progress=progress)
    there = found is not None and bool(found.track.has_pose.any())
    track = found.track if found is not None and there else None
    if file is not None:
        with suppress(OSError, OutputError):  # it costs time, nothing else
            file.parent.mkdir(parents=True, exist_ok=True)
            write_file(file, run_bytes(Run(trial, None if track is None else Estimate(track))))
    return track
