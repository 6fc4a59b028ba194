"""Logs of a fleet of three sites, with things that go wrong and an answer that is known.

    python recipes/fleet/simulate_fleet.py -o fleet_logs

- harbour, a warehouse: from day 3 on the racks along one aisle stand elsewhere. That aisle, and no
  other place, needs to be mapped again.
- hospital, an office floor: on day 2 a pallet stands in the way. It is gone the day after, and
  nothing needs to be mapped again.
- plant, a warehouse: two robots get software 2.4.0 on day 3. It restores a pose of long ago at the
  start and is sure of it, so that they get lost; the others keep 2.3.1 and do not.

Beside that a few kidnappings, slipping wheels and crowds; most logs are healthy. Each log is half a
minute. The same seed gives the same bytes. OUT/truth.json holds the answers, OUT/maps.csv the
labels for `slamreplay batch --maps`.
"""

from __future__ import annotations

import argparse
import csv
import json
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np

from slamreplay.bench.crowds import crowd
from slamreplay.bench.truth import changes_of
from slamreplay.geometry import se2
from slamreplay.simulate import truth
from slamreplay.simulate.drive import BackUp, Carry, Follow, Pause, Slip, Spin, Step, drive
from slamreplay.simulate.halls import bounds_of, random_warehouse
from slamreplay.simulate.localizer import odometry_at
from slamreplay.simulate.offices import random_office
from slamreplay.simulate.recording import Recording, record
from slamreplay.simulate.routes import XY, Floor, Ways
from slamreplay.simulate.scenarios import Scenario
from slamreplay.simulate.sensors import Lidar, WheelErrors
from slamreplay.simulate.topics import records
from slamreplay.simulate.worlds import Solid, World, box
from slamreplay.simulate.writer import write_log

SITES = ("harbour", "hospital", "plant")
FIRST_DAY = datetime(2026, 3, 2, 6, 0, tzinfo=UTC)
MOVED_FROM_DAY, PALLET_DAY, UPDATE_DAY = 3, 2, 3
OLD, USUAL, NEW = "2.2.4", "2.3.1", "2.4.0"
UPDATED = 2  # so many robots of the plant get the new software
#: What else goes wrong: (site, robot of the site, day) to what.
MISHAPS = {
    ("harbour", 1, 2): "crowd",
    ("harbour", 2, 1): "kidnapped",
    ("harbour", 3, 5): "wheel_slip",
    ("hospital", 1, 4): "kidnapped",
    ("hospital", 2, 3): "wheel_slip",
    ("hospital", 4, 5): "crowd",
    ("plant", 1, 2): "crowd",
    ("plant", 3, 4): "wheel_slip",
    ("plant", 4, 6): "kidnapped",
}
_LEAST_CLEAR_M, _LONGEST_S = 0.27, 48.0
_RECOVERIES = (Pause(0.3, "ClearLocalCostmap-Context"), Spin(1.57), Pause(3.0, "Wait"), BackUp())


@dataclass(frozen=True, eq=False)
class Site:
    """A place, how it changes, and the stretch that every tour comes through.

    Attributes:
        name: one of `SITES`.
        mapped: what its map was drawn from.
        changed: what stands there while it is changed.
        floor: where a robot has room whether it is changed or not.
        stretch: both ends of what every tour comes through.
        ways: from each of them.
        box_m: around what changes: least x and y, greatest x and y.
    """

    name: str
    mapped: World
    changed: World
    floor: Floor
    stretch: tuple[XY, XY]
    ways: tuple[Ways, Ways]
    box_m: tuple[float, float, float, float]


def site_of(name: str, seed: int) -> Site:
    """One of `SITES`; the seed draws the place."""
    for attempt in range(200):
        rng = np.random.Generator(np.random.PCG64([seed, SITES.index(name), attempt]))
        if name == "hospital":
            mapped = random_office(rng)
        else:
            mapped = random_warehouse(rng, (rng.uniform(20.0, 28.0), rng.uniform(14.0, 18.0)))
        made = _with_moved_aisle(name, mapped, rng) if name == "harbour" else None
        made = _with_pallet(name, mapped, rng) if name != "harbour" else made
        if made is not None:
            return made
    raise AssertionError(f"no {name} of seed {seed} has the room")


def _with_moved_aisle(name: str, mapped: World, rng: np.random.Generator) -> Site | None:
    """Two racks that stand next to each other are moved; tours go along them."""
    rows: dict[str, list[Solid]] = {}
    for solid in mapped.solids:
        if solid.name.startswith("rack"):
            rows.setdefault(solid.name.split(".")[0], []).append(solid)
    for row in rng.permutation(sorted(rows)):
        along = int(np.argmax(np.subtract(_around(rows[row])[2:], _around(rows[row])[:2])))
        middle = len(rows[row]) // 2
        racks = rows[row][middle - 1 : middle + 1]
        if len(racks) < 2 or not 4.0 < _around(racks)[2 + along] - _around(racks)[along] < 9.0:
            continue
        before = _around(racks)
        # Not all by one step: a filter would follow that, and be lost rather than see a change.
        steps = (np.roll(step, along) for step in ((-0.7, 0.5), (0.7, 0.6)))
        now = [_moved(solid, step) for solid, step in zip(racks, steps, strict=True)]
        changed = mapped.changed(without=[s.name for s in racks], added=now)
        floor = Floor.of(mapped, changed)
        for off_m in (-1.0, -1.2, -1.4, 1.2, 1.4, 1.6):
            ends = np.array([[before[0], before[1]], [before[2], before[3]]])
            ends[:, along] = before[along] + np.array([0.15, 0.85]) * (
                before[2 + along] - before[along]
            )
            ends[:, 1 - along] = before[1 - along if off_m < 0 else 3 - along] + off_m
            if floor.at(ends).min() > 0.7 and floor.sees(*ends):
                ways = tuple(floor.ways((float(x), float(y))) for x, y in ends)
                stretch = tuple((float(x), float(y)) for x, y in ends)
                return Site(name, mapped, changed, floor, stretch, ways, _around([*racks, *now]))
    return None


def _moved(solid: Solid, step: se2.Array) -> Solid:
    corners = tuple((float(x + step[0]), float(y + step[1])) for x, y in solid.corners)
    return replace(solid, name=f"{solid.name} moved", corners=corners)


def _with_pallet(name: str, mapped: World, rng: np.random.Generator) -> Site | None:
    """A pallet in the middle of a straight stretch of 7 to 10 m."""
    floor = Floor.of(mapped)
    start = floor.random_place(rng, 0.75)
    ways = floor.ways(start)
    for place in rng.permutation(ways.within(7.0, 10.0))[:40]:
        end = ways.centres[place]
        if floor.at(end)[0] > 0.75 and floor.sees(np.array(start), end):
            x, y = (np.array(start) + end) / 2.0
            pallet = box("pallet", float(x) - 0.6, float(y) - 0.4, 1.2, 0.8, 0.2)
            stretch = (start, (float(end[0]), float(end[1])))
            changed = mapped.changed(added=(pallet,))
            both = (ways, floor.ways(stretch[1]))
            return Site(name, mapped, changed, floor, stretch, both, bounds_of(pallet))
    return None


def _around(solids: list[Solid]) -> tuple[float, float, float, float]:
    """Least x and y, greatest x and y."""
    low, high = (np.array([bounds_of(s) for s in solids])[:, k : k + 2] for k in (0, 2))
    return (*(float(v) for v in low.min(axis=0)), *(float(v) for v in high.max(axis=0)))


def software_of(site: str, robot: int, day: int) -> str:
    """The version that a robot of a site ran on a day."""
    if site == "plant" and robot <= UPDATED and day >= UPDATE_DAY:
        return NEW
    return OLD if site == "hospital" and day < PALLET_DAY + 2 else USUAL


def what_happens(site: str, robot: int, day: int, n: int) -> str:
    """What is done to one log."""
    if site == "plant" and software_of(site, robot, day) == NEW:
        return "stale_start" if (robot + day + n) % 4 else "healthy"
    if site == "hospital" and day == PALLET_DAY:
        return "pallet"
    return MISHAPS.get((site, robot, day), "healthy") if n == 1 else "healthy"


def story_of(site: Site, what: str, day: int, rng: np.random.Generator) -> Scenario | None:
    """One try of a tour; None where it comes too near to something or takes too long."""
    moved = site.name == "harbour" and day >= MOVED_FROM_DAY
    standing = site.changed if moved or what == "pallet" else site.mapped
    first, last = (0, 1) if rng.random() < 0.5 else (1, 0)
    a, b = site.stretch[first], site.stretch[last]
    to_start, to_goal = (_drawn(site.ways[k], rng) for k in (first, last))
    if not to_start or not to_goal:
        return None
    start = to_start[-1]
    heading = float(np.arctan2(*(np.array((*to_start[-2::-1], a)[0]) - start)[::-1]))
    begin = (*start, heading + float(rng.uniform(-0.4, 0.4)))
    speed = float(rng.uniform(0.7, 0.9))
    slip = Slip(2.0, 5.0, 0.1, float(rng.choice([-0.1, 0.1]))) if what == "wheel_slip" else None
    inward = Follow((*to_start[-2::-1], a), speed=speed)
    through = (Follow((b, *to_goal), speed=speed, slip=slip),)
    if what == "pallet":
        stop = np.array(a) + (np.array(b) - a) * (0.5 - 1.6 / np.hypot(*(np.array(b) - a)))
        here = (float(stop[0]), float(stop[1]))
        through = (Follow((here,), speed, beyond=(b, *to_goal)), *_RECOVERIES, Follow((a, start)))
    elif what == "kidnapped":
        carry = Carry((*to_goal[-1], float(rng.uniform(-np.pi, np.pi))))
        back = Follow((*to_goal[-2::-1], b), speed)
        through = (carry, Pause(1.0), back, *_RECOVERIES, Follow((a,), speed))
    elif what in ("wheel_slip", "stale_start"):
        through = (*through, *_RECOVERIES[:3])
    tour: tuple[Step, ...] = (Pause(1.5), inward, *through, Pause(1.5))
    motion = drive(begin, tour)
    if motion.t_s[-1] > _LONGEST_S:
        return None
    if Floor.of(site.mapped, standing).at(motion.xyyaw[:, :2]).min() < _LEAST_CLEAR_M:
        return None
    scale, turn_scale, pull = rng.normal(0.0, (0.006, 0.008, 0.0012))
    people = crowd(site.floor, motion, 14 if what == "crowd" else int(rng.integers(0, 3)), rng)
    story = Scenario(
        site.mapped,
        standing,
        begin,
        tour,
        "",
        int(rng.integers(2**31)),
        walkers=people,
        lidar=Lidar(beams=271, field_of_view=np.radians(270.0), range_max_m=18.0),
        wheels=WheelErrors(float(scale), float(turn_scale), float(pull)),
    )
    if what == "stale_start":
        off = _drawn(site.ways[last], rng)
        old = (*(off or to_goal)[-1], float(rng.uniform(-np.pi, np.pi)))
        return replace(story, believed_start=old, start_sigmas=(0.1, 0.1, 0.05))
    return story


def _drawn(ways: Ways, rng: np.random.Generator) -> tuple[XY, ...]:
    """Corners to a place some metres away."""
    places = ways.within(3.5, 7.0)
    return ways.to(int(places[rng.integers(len(places))]))


def truth_of(r: Recording) -> dict[str, object]:
    """What the truth says of a log, by the definitions of the report."""
    t_s = r.scans.t_s
    belief = se2.compose(r.beliefs.map_odom, odometry_at(r.odometry, t_s))
    far = truth.is_far(belief, r.motion.poses_at(t_s))
    share, _ = changes_of(r, np.zeros(3))
    beyond = share > truth.CHANGED_SHARE
    return {
        "state": truth.verdict(t_s, far, t_s, share),
        "lost_s": round(truth.total_s(t_s, far, truth.LOST_FOR_S), 1),
        "changed_s": round(truth.total_s(t_s, beyond, truth.CHANGED_FOR_S), 1),
    }


def write_fleet(out: Path, *, robots: int, days: int, per_day: int, seed: int) -> None:
    """All logs, the table of labels and the answers."""
    logs: dict[str, dict[str, object]] = {}
    answers: dict[str, object] = {}
    rows = []
    for s, name in enumerate(SITES):
        site = site_of(name, seed)
        changes = {"harbour": "moved for good", "hospital": "in the way on one day"}
        box_m = [round(v, 2) for v in site.box_m]
        answers[name] = {
            "needs_mapping": box_m if name == "harbour" else None,
            "what_changed": changes.get(name),
            "changed_box_m": None if name == "plant" else box_m,
            "changed_from_day": {"harbour": MOVED_FROM_DAY, "hospital": PALLET_DAY}.get(name),
            "worse_software": NEW if name == "plant" else None,
        }
        for robot in range(1, robots + 1):
            label = f"amr-{4 * s + robot:02d}" if robots <= 4 else f"{name}-{robot:03d}"
            folder = out / name / label
            folder.mkdir(parents=True, exist_ok=True)
            for day in range(1, days + 1):
                date = FIRST_DAY + timedelta(days=day - 1, hours=2 * robot)
                software = software_of(name, robot, day)
                rows.append((f"*/{name}/{label}/{date:%Y-%m-%d}_*.mcap", "", name, label, software))
                for n in range(1, per_day + 1):
                    what = what_happens(name, robot, day, n)
                    begins = date + timedelta(minutes=37 * n)
                    recording = _recorded(site, what, (seed, s, robot, day, n), begins)
                    log = folder / f"{date:%Y-%m-%d}_{n}.mcap"
                    write_log(log, lambda messages, r=recording: records(r, messages))
                    told = {"what": what, "day": day, "software": software, **truth_of(recording)}
                    logs[log.relative_to(out).as_posix()] = told
                    print(log, what, told["state"], f"{recording.motion.t_s[-1]:.0f} s", flush=True)
    with (out / "maps.csv").open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerows([("pattern", "map", "site", "robot", "software"), *rows])
    text = json.dumps({"seed": seed, "sites": answers, "logs": logs}, indent=1)
    (out / "truth.json").write_text(text + "\n", encoding="utf-8")


def _recorded(site: Site, what: str, seeds: tuple[int, ...], begins: datetime) -> Recording:
    """The first tour drawn that can be driven, begun at that time."""
    for attempt in range(200):
        rng = np.random.Generator(np.random.PCG64([*seeds, attempt]))
        story = story_of(site, what, seeds[3], rng)
        if story is not None:
            return record(replace(story, start_ns=int(begins.timestamp()) * 1_000_000_000))
    raise AssertionError(f"no tour of {site.name} can be driven")


def main() -> None:
    """Read the command line and write the logs."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="OUT")
    parser.add_argument("--robots", type=int, default=4, help="of each site (default 4)")
    parser.add_argument("--days", type=int, default=6, help="(default 6)")
    parser.add_argument("--per-day", type=int, default=1, help="logs of a robot (default 1)")
    parser.add_argument("--seed", type=int, default=0, help="of every place and tour (default 0)")
    asked = parser.parse_args()
    write_fleet(
        asked.output, robots=asked.robots, days=asked.days, per_day=asked.per_day, seed=asked.seed
    )


if __name__ == "__main__":
    main()
