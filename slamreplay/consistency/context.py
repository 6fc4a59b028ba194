"""What a check is given."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from slamreplay.audit.log_audit import LogAudit
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView


@dataclass(frozen=True, eq=False)
class CheckContext:
    """A belief, what to hold it against, and the evidence it came from.

    Attributes:
        belief: what the robot believed; None where no localizer spoke. Checks of the covariance
            read the poses table as well, for there it stands as it was published.
        reference: the best independent idea of the truth, None where the log has none.
        reference_kind: simulation, motion_capture, survey, gnss, fiducial, dock or hindsight.
        view: the log, without references that only judge.
    """

    belief: PoseTrack | None
    reference: PoseTrack | None
    reference_kind: str | None
    view: BundleView

    @cached_property
    def audit(self) -> LogAudit:
        """What was measured of the log's clocks, transforms and numbers."""
        return LogAudit(self.view)
