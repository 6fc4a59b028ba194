"""The simulated fleet: what is wrong in it is known, and stays so for every seed."""

import json
import runpy
from pathlib import Path

import numpy as np
import pytest

from slamreplay.geometry.times import NS_PER_S
from slamreplay.ingest.pipeline import ingest

SCRIPT = Path(__file__).resolve().parents[1] / "recipes" / "fleet" / "simulate_fleet.py"


@pytest.fixture(scope="module")
def script():
    return runpy.run_path(str(SCRIPT))


@pytest.fixture(scope="module")
def fleet(script, tmp_path_factory):
    out = tmp_path_factory.mktemp("fleet")
    script["write_fleet"](out, robots=1, days=1, per_day=1, seed=3)
    return out


def test_each_log_begins_on_its_day_and_the_table_names_it(fleet):
    (log,) = (fleet / "hospital").rglob("*.mcap")
    rows = (fleet / "maps.csv").read_text(encoding="utf-8").splitlines()

    assert log.relative_to(fleet).as_posix() == "hospital/amr-05/2026-03-02_1.mcap"
    assert rows[0] == "pattern,map,site,robot,software"
    assert "*/hospital/amr-05/2026-03-02_*.mcap,,hospital,amr-05,2.2.4" in rows
    manifest = ingest([log], fleet / "bundle").manifest
    started = np.datetime64(manifest.start_ns // NS_PER_S, "s")
    assert str(started) == "2026-03-02T08:37:00"


def test_same_seed_same_bytes(script, fleet, tmp_path):
    script["write_fleet"](tmp_path, robots=1, days=1, per_day=1, seed=3)

    names = sorted(p.relative_to(fleet) for p in fleet.rglob("*.*") if "bundle" not in p.parts)
    assert len(names) == 5
    for name in names:
        assert (fleet / name).read_bytes() == (tmp_path / name).read_bytes()


def test_the_answers_are_in_the_world(script, fleet):
    answers = json.loads((fleet / "truth.json").read_text(encoding="utf-8"))["sites"]
    needs = {name: answer["needs_mapping"] is not None for name, answer in answers.items()}
    sites = {name: script["site_of"](name, 3) for name in script["SITES"]}

    assert needs == {"harbour": True, "hospital": False, "plant": False}
    assert len(set(sites["harbour"].changed.solids) - set(sites["harbour"].mapped.solids)) == 2
    assert len(sites["hospital"].changed.solids) == len(sites["hospital"].mapped.solids) + 1


@pytest.mark.parametrize(
    ("site", "what", "day", "state"),
    [
        ("harbour", "healthy", 2, "healthy"),
        ("harbour", "healthy", 3, "map_changed"),
        ("hospital", "pallet", 2, "map_changed"),
        ("plant", "stale_start", 3, "lost"),
    ],
)
def test_truth_of_what_is_done(script, site, what, day, state):
    begins = script["FIRST_DAY"]
    recording = script["_recorded"](script["site_of"](site, 0), what, (0, 0, 1, day, 1), begins)

    assert script["truth_of"](recording)["state"] == state


def test_only_updated_robots_of_the_plant_start_wrongly(script):
    happens, software = script["what_happens"], script["software_of"]
    told = {(s, r, d): happens(s, r, d, 1) for s in script["SITES"] for r in (1, 2, 3, 4)
            for d in range(1, 7)}  # fmt: skip

    stale = [key for key, what in told.items() if what == "stale_start"]
    assert len(stale) == 6
    assert {software(*key) for key in stale} == {"2.4.0"}
    assert {what for (_, _, day), what in told.items() if what == "pallet" and day != 2} == set()
