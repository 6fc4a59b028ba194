"""Long logs for measuring cost: a tour of many minutes through a hall of any size."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from slamreplay.bench.crowds import crowd
from slamreplay.bench.structure import boxes_added, racks_removed
from slamreplay.bundle.view import Bundle
from slamreplay.ingest.options import IngestOptions
from slamreplay.ingest.pipeline import ingest
from slamreplay.simulate.drive import Follow, Pause, drive
from slamreplay.simulate.halls import random_warehouse
from slamreplay.simulate.recording import record
from slamreplay.simulate.routes import Floor, random_route
from slamreplay.simulate.scenarios import Scenario
from slamreplay.simulate.sensors import Lidar
from slamreplay.simulate.topics import records
from slamreplay.simulate.writer import write_log

#: 360 beams at 10 Hz, as the goal asks; this many people walk about at any length of log.
LIDAR = Lidar(beams=360, field_of_view=np.radians(359.0), range_max_m=20.0)
PEOPLE = 6
#: Metres of tour per second of log: pauses and turns take the rest.
M_PER_S = 0.55


def long_log(log: Path, size_m: float, seconds: float, seed: int) -> Path:
    """Write a log of that many seconds and more in a hall with racks gone and boxes put down."""
    rng = np.random.Generator(np.random.PCG64(seed))
    hall = random_warehouse(rng, (size_m, size_m))
    floor = Floor.of(hall)
    start = floor.random_place(rng, 0.8)
    length_m = M_PER_S * seconds
    while True:
        legs = random_route(floor, rng, start, length_m)
        tour = tuple(step for leg in legs for step in (Follow(leg), Pause(2.0)))
        motion = drive((*start, 0.0), tour)
        if motion.t_s[-1] >= seconds:
            break
        length_m *= 1.05 * seconds / motion.t_s[-1]
    story = Scenario(hall, hall, (*start, 0.0), tour, "", seed, lidar=LIDAR)
    way = motion.xyyaw[::10, :2]
    story = replace(
        story,
        standing=boxes_added(racks_removed(hall, way, rng), way, rng),
        true_resolution_m=0.04,
        walkers=crowd(floor, motion, PEOPLE, rng),
    )
    recording = record(story)
    write_log(log, lambda messages: records(recording, messages))
    return log


def long_bundle(log: Path, folder: Path, seconds: float) -> Bundle:
    """The first seconds of a log as a bundle."""
    return ingest([log], folder, IngestOptions(end_s=seconds))
