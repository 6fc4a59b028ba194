"""What the navigator says it does: the status changes of a Nav2 behaviour tree."""

from __future__ import annotations

from dataclasses import dataclass

from slamreplay.simulate.drive import RATE_HZ, Carry, Follow, Motion, Phase

#: Nodes of Nav2's default tree that this robot's log shows, each with its number in the tree.
_NODES = (
    "NavigateRecovery",
    "ComputePathToPose",
    "FollowPath",
    "RecoveryActions",
    "ClearLocalCostmap-Context",
    "Spin",
    "Wait",
    "BackUp",
)
_PLANNING_S = 0.06


@dataclass(frozen=True)
class StatusChange:
    """At `t_s` the node went from one status to another (IDLE, RUNNING, SUCCESS, FAILURE)."""

    t_s: float
    node: str
    before: str
    after: str

    @property
    def uid(self) -> int:
        """The node's number in the tree."""
        return _NODES.index(self.node) + 1


def status_changes(motion: Motion) -> tuple[StatusChange, ...]:
    """The log of the tree in time order.

    A goal is given where a path follows a rest; a named behaviour after a path means that following
    it failed, and the tree goes on to the same goal when the recoveries are through.
    """
    log: list[StatusChange] = []
    navigating = recovering = False
    for phase, after in zip(motion.phases, [*motion.phases[1:], None], strict=True):
        start, end = phase.first / RATE_HZ, phase.last / RATE_HZ
        name = _recovery(phase)
        if name:
            if not recovering:
                log.append(StatusChange(start, "RecoveryActions", "IDLE", "RUNNING"))
            recovering = True
            log.append(StatusChange(start, name, "IDLE", "RUNNING"))
            log.append(StatusChange(end, name, "RUNNING", "SUCCESS"))
            if after is None or not _recovery(after):
                log.append(StatusChange(end, "RecoveryActions", "RUNNING", "SUCCESS"))
                recovering = False
        elif isinstance(phase.step, Follow):
            if not navigating:
                log.append(StatusChange(start, "NavigateRecovery", "IDLE", "RUNNING"))
            log.append(StatusChange(start, "ComputePathToPose", "IDLE", "RUNNING"))
            planned = start + _PLANNING_S
            log.append(StatusChange(planned, "ComputePathToPose", "RUNNING", "SUCCESS"))
            log.append(StatusChange(planned, "FollowPath", "IDLE", "RUNNING"))
            blocked = after is not None and _recovery(after) is not None
            outcome = "FAILURE" if blocked else "SUCCESS"
            log.append(StatusChange(end, "FollowPath", "RUNNING", outcome))
            if not blocked:
                log.append(StatusChange(end, "NavigateRecovery", "RUNNING", "SUCCESS"))
            navigating = blocked
    return tuple(log)


def _recovery(phase: Phase) -> str | None:
    """The behaviour that a step stands for, if it is one."""
    if isinstance(phase.step, Follow | Carry):
        return None
    return phase.step.name or None
