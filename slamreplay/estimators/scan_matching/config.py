"""What may be set of scan matching."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class MatchConfig:
    """Hyper-parameters of local scan matching, one set for all logs.

    Attributes:
        node_m: a scan becomes a node after so much motion, m.
        node_rad: or after so much turning, rad.
        memory: how many nodes back the local map reaches.
    """

    node_m: float = 0.2
    node_rad: float = 0.2
    memory: int = 15
