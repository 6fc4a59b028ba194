"""What a check is given."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from slamreplay.audit.log_audit import LogAudit
from slamreplay.bundle.run import Innovations, Run
from slamreplay.bundle.schema import SENSED_KINDS
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.consistency.evidence.belonging import (
    Belonging,
    belonging_of_robot,
    belonging_of_run,
)
from slamreplay.consistency.evidence.source import Evidence, Reference
from slamreplay.geometry.se2 import Array


@dataclass(frozen=True, eq=False)
class CheckContext:
    """A belief, what to hold it against, and the evidence it came from.

    Attributes:
        belief: what the robot, or an estimator, believed; None where no localizer spoke. Checks of
            the covariance read the poses table as well, for there it stands as it was published.
        references: independent ideas of the truth, the best first, hindsight last.
        view: the log, without references that only judge.
        subject: the estimator whose run this is; empty for the robot's own localizer.
        innovations: what each measurement said against the estimator's prediction, by source.
        diagnostics: the estimator's further columns, one row per row of the belief.
    """

    belief: PoseTrack | None
    references: tuple[Reference, ...]
    view: BundleView
    subject: str = ""
    innovations: tuple[Innovations, ...] = ()
    diagnostics: Mapping[str, Array] = field(default_factory=lambda: MappingProxyType({}))

    @classmethod
    def of_run(cls, run: Run, references: tuple[Reference, ...], view: BundleView) -> CheckContext:
        """What a run of an estimator is asked by; one without an estimate has no belief."""
        if run.estimate is None:
            return cls(None, references, view, run.trial.estimator)
        estimate = run.estimate
        return cls(estimate.track, references, view, run.trial.estimator, estimate.innovations,
                   estimate.diagnostics)  # fmt: skip

    @property
    def reference(self) -> Reference | None:
        """The best one."""
        return self.references[0] if self.references else None

    @cached_property
    def updates(self) -> PoseTrack | None:
        """The rows at which the belief was really updated, None without any covariance.

        A covariance that was merely held between them would count the same evidence again.
        """
        from slamreplay.consistency.evidence.gathering import updates_of  # loads scipy

        return updates_of(self.belief, self.view, self.subject, self.diagnostics)

    @cached_property
    def evidence(self) -> tuple[Evidence, ...]:
        """The updates' errors against each source that can tell, the best first."""
        if self.updates is None:
            return ()
        from slamreplay.consistency.evidence.gathering import evidence_of

        used = {kind for kind in SENSED_KINDS for i in self.innovations if kind in i.source}
        return evidence_of(self.updates, self.references, self.view, used, self.left_out)

    @cached_property
    def belonging(self) -> Belonging | None:
        """Whether mean and covariance of the updates are of the same particles; None if unknown."""
        if self.updates is None:
            return None
        if not self.subject:
            return belonging_of_robot(self.updates, self.view)
        assert self.belief is not None  # or it would have no updates
        return belonging_of_run(self.updates, self.belief, self.diagnostics)

    @property
    def left_out(self) -> NDArray[np.bool_] | None:
        """(N,) updates that no error is to be held against, None where all may be."""
        return None if self.belonging is None else self.belonging.left_out

    @cached_property
    def audit(self) -> LogAudit:
        """What was measured of the log's clocks, transforms and numbers."""
        return LogAudit(self.view)
