"""A drive with worn wheels over codes in the floor, as a log that only knows what robots know."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.view import Bundle
from slamreplay.geometry.times import NS_PER_S
from slamreplay.simulate.bundled import bundle_of
from slamreplay.simulate.codes import CodeFloor
from slamreplay.simulate.drive import Follow, Pause, Step
from slamreplay.simulate.recording import Recording, record
from slamreplay.simulate.scenarios import Scenario
from slamreplay.simulate.sensors import WheelErrors
from slamreplay.simulate.topics import Record
from slamreplay.simulate.worlds import warehouse

_START = (1.5, 1.3, 0.0)
_WAY = ((9.0, 1.2), (15.3, 1.2), (15.3, 4.6), (9.0, 4.6), (1.5, 4.6), (1.5, 8.0), (9.0, 8.0),
        (15.3, 8.0), (15.3, 4.6), (3.2, 4.6))  # fmt: skip
#: Codes on the middle line of each aisle: none is ever worn or misread.
_CODES = CodeFloor((1.5, 1.2), columns=9, rows=5, spacing_m=1.7, worn=0.0, misread=0.0)
#: Of a robot that starts at its dock: what it really is off by, after the simulator.
_START_COV = np.diag([0.08**2, 0.08**2, 0.0, 0.0, 0.0, 0.03**2]).ravel()
_TRUTH = "/slamreplay/reference"
#: Sightings so near in time are of one code.
_ONE_CODE_NS = NS_PER_S // 2


def drive(wheels: WheelErrors, seed: int) -> Recording:
    """Through three aisles, with a stop at each corner: 70 m."""
    hall = warehouse()
    tour: list[Step] = [Pause(2.0)]
    for corner in _WAY:
        tour += [Follow((corner,)), Pause(1.0)]
    story = Scenario(hall, hall, _START, tuple(tour), "", seed, wheels=wheels, floor=_CODES)
    return record(story)


def log_of(recording: Recording) -> Bundle:
    """Its log without the simulator's truth, begun with the covariance of a dock."""
    return bundle_of(recording, edit=_of_a_robot)


def _of_a_robot(records: Sequence[Record]) -> Sequence[Record]:
    kept = [r for r in records if r.topic != _TRUTH]
    return [_docked(r) if r.topic == "/initialpose" else r for r in kept]


def _docked(record: Record) -> Record:
    posed = record.message
    pose = replace(posed.pose, covariance=_START_COV)
    return replace(record, message=replace(posed, pose=pose))


def seen_every(bundle: Bundle, every_s: float | None) -> Bundle:
    """The log with a code seen once in so many seconds only; None: with none."""
    table = bundle.table("references")
    if every_s is None:
        kept = np.zeros(len(table), dtype=bool)
    else:
        t_ns = table.t_ns - table.t_ns.min(initial=bundle.manifest.end_ns)
        bucket = t_ns // round(every_s * NS_PER_S)
        _, first, row = np.unique(bucket, return_index=True, return_inverse=True)
        kept = t_ns - t_ns[first][row] < _ONE_CODE_NS
    tables = {name: bundle.table(name) for name in TABLES}
    return Bundle(bundle.manifest, tables | {"references": table.take(kept)}, bundle.grids())
