"""One confusion in one healthy log: what estimators make of it, and what audit and report say."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from slamreplay.bundle.findings import Finding
from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.view import Bundle, BundleView
from slamreplay.consistency import AUDITS
from slamreplay.consistency.asking import ask
from slamreplay.consistency.context import CheckContext
from slamreplay.errors import NotApplicableError
from slamreplay.estimators import ESTIMATORS
from slamreplay.geometry import se2
from slamreplay.perturb import PERTURBATIONS
from slamreplay.postmortem import postmortem
from slamreplay.simulate.recording import Recording
from slamreplay.simulate.topics import START_NS

#: Farther from the truth than this an estimator is off, as in the verdict.
OFF_M, OFF_RAD = 0.5, np.radians(20.0)
_RAISED = ("warning", "error")


@dataclass(frozen=True)
class Ran:
    """One estimator on the log.

    Attributes:
        error_m: its largest error of position, None without a pose.
        error_deg: its largest error of heading.
        off_s: since the log's start, when it was off first; None where it never was.
    """

    error_m: float | None
    error_deg: float | None
    off_s: float | None


@dataclass(frozen=True)
class Confused:
    """What one confusion did.

    Attributes:
        ran: by estimator.
        state: the verdict,
        mode: how it says that it began.
        audit: ids of warnings and errors of `inspect`, and
        report: of the report beside these.
        named: the sentences of those findings that name a unit or a hand.
    """

    ran: dict[str, Ran]
    state: str
    mode: str
    audit: tuple[str, ...]
    report: tuple[str, ...]
    named: tuple[str, ...]


def confused(
    name: str | None, bundle: Bundle, recording: Recording, estimators: Sequence[str], seed: int
) -> Confused:
    """The log with a confusion, run, audited and looked back on; None is the log as it is.

    Raises:
        NotApplicableError: the log has nothing to confuse.
    """
    view = bundle.view()
    if name is not None:
        short, _, variant = name.partition(".")
        rng = np.random.Generator(np.random.PCG64(seed))
        view = PERTURBATIONS.load(short)().apply(view, variant, 1.0, rng)
    ran = {one: _ran(one, view, recording, seed) for one in estimators}
    log = _recorded_so(view)
    audit = ask([CheckContext(None, (), log.view())], AUDITS)
    post = postmortem(log, scene=False)
    told = _ids(audit)
    return Confused(
        ran,
        post.judgement.state,
        post.judgement.failure_mode.kind,
        told,
        tuple(i for i in _ids(post.findings) if i not in told),
        tuple(f.message for f in post.findings if f.id == "SR-ODO-003"),
    )


def _recorded_so(view: BundleView) -> Bundle:
    """The log as if its drivers had told it so."""
    tables = {name: view.recorded(name) for name in TABLES}
    grids = {**view.bundle.grids(), **view.redrawn}
    if view.replaced_grid is not None:
        grids = dict.fromkeys(grids, view.replaced_grid)
    return Bundle(view.manifest, tables, grids)


def _ids(findings: Sequence[Finding]) -> tuple[str, ...]:
    return tuple(sorted({f.id for f in findings if f.severity in _RAISED}))


def _ran(name: str, view: BundleView, recording: Recording, seed: int) -> Ran:
    try:
        track = ESTIMATORS.load(name)().run(view, seed=seed).track
    except NotApplicableError:  # no beam is left, no turn that could be told
        return Ran(None, None, 0.0)
    track = track.take(track.has_pose)
    if not len(track):
        return Ran(None, None, 0.0)
    t_s = (track.t_ns - START_NS) / 1e9
    true = recording.motion.poses_at(t_s)
    far = np.hypot(*(track.xyyaw - true)[:, :2].T)
    turned = np.abs(se2.wrap_angle(track.xyyaw[:, 2] - true[:, 2]))
    off = np.flatnonzero((far > OFF_M) | (turned > OFF_RAD))
    when = float(t_s[off[0]]) if len(off) else None
    return Ran(float(far.max()), float(np.degrees(turned.max())), when)
