"""A round through the warehouse, with and without a stretch on which the wheels slip."""

from __future__ import annotations

from slamreplay.simulate.drive import Follow, Pause, Slip
from slamreplay.simulate.recording import Recording, record
from slamreplay.simulate.scenarios import Scenario
from slamreplay.simulate.worlds import warehouse

_START = (1.5, 1.3, 0.0)
#: Along the first aisle, back through the second one, and along the first again.
_ROUND = ((15.3, 1.2), (15.3, 4.6), (3.2, 4.6), (1.5, 4.6), (1.5, 1.4), (4.0, 1.2), (13.0, 1.2))


def round_trip(slip: Slip | None, seed: int) -> Recording:
    """The drive; the robot moves the same in every log up to the slip."""
    hall = warehouse()
    tour = (Pause(2.0), Follow(_ROUND, slip=slip), Pause(2.0))
    return record(Scenario(hall, hall, _START, tour, "healthy", seed))
