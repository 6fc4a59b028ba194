"""Whether a batch over the simulated fleet came to the answers that are known.

    python recipes/fleet/check_answers.py fleet_logs fleet

Exits with 1 where an answer is another one.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from pathlib import Path

from slamreplay.fleet.answering import answers
from slamreplay.fleet.answers import Answers, Area
from slamreplay.fleet.store import read


def right_states(logs: dict[str, dict[str, str]], fleet: Path) -> bool:
    """How many verdicts are those of the truth, and which are not."""
    rows = read(fleet, "logs").select(["log", "state"]).to_pylist()
    found = {log: r["state"] for r in rows for log in logs if r["log"].endswith(f"/{log}")}
    other = {log: state for log, state in found.items() if state != logs[log]["state"]}
    print(f"{len(found) - len(other)} of {len(logs)} logs have the state that the truth gives them")
    for log, state in sorted(other.items()):
        print(f"  {log}: {state}, but it is {logs[log]['state']} ({logs[log]['what']})")
    return len(found) == len(logs) and not other


def right_aisles(sites: dict[str, dict[str, list[float] | None]], found: Answers) -> bool:
    """Whether the aisle that was changed for good, and nothing else, is to be mapped again."""
    advised = [area for area in found.areas if area.advice == "re-map"]
    is_right = True
    for site, answer in sites.items():
        here = [area for area in advised if area.site == site]
        box = answer["needs_mapping"]
        hits = [area for area in here if box is not None and _overlap(area, box)]
        is_right &= len(hits) == len(here) and bool(hits) == (box is not None)
        wanted = "its changed aisle" if box else "nothing"
        print(f"{site}: to be mapped again {len(here)} areas, {len(hits)} there; wanted: {wanted}")
    return is_right


def _overlap(area: Area, box: list[float]) -> bool:
    x0, y0, x1, y1 = area.box_m
    return x0 < box[2] and x1 > box[0] and y0 < box[3] and y1 > box[1]


def right_software(sites: dict[str, dict[str, str | None]], found: Answers) -> bool:
    """Whether the worse version, and no other, is told to lose more robots than the one before."""
    worse = Counter(s.after for s in found.steps if s.measure == "lost" and s.verdict == "worse")
    wanted = {a["worse_software"] for a in sites.values() if a["worse_software"] is not None}
    print(f"software that loses more robots: {sorted(worse)}; wanted: {sorted(wanted)}")
    return set(worse) == wanted


def main() -> None:
    """Read the command line and compare."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("logs", type=Path, help="folder that simulate_fleet.py wrote")
    parser.add_argument("fleet", type=Path, help="folder of slamreplay batch or watch")
    asked = parser.parse_args()
    truth = json.loads((asked.logs / "truth.json").read_text(encoding="utf-8"))
    found = answers(asked.fleet)
    checks = (
        right_states(truth["logs"], asked.fleet),
        right_aisles(truth["sites"], found),
        right_software(truth["sites"], found),
    )
    sys.exit(0 if all(checks) else 1)


if __name__ == "__main__":
    main()
