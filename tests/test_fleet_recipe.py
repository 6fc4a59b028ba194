"""The simulated fleet: what is wrong in it is known, and stays so for every seed."""

import json
import os
import runpy
import subprocess
from importlib import import_module
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
import typer
import yaml

from slamreplay.batch.folder import batch_folder
from slamreplay.fleet.schema import arrow_schema
from slamreplay.fleet.store import commit, read
from slamreplay.geometry.times import NS_PER_S
from slamreplay.ingest.pipeline import ingest

FOLDER = Path(__file__).resolve().parents[1] / "recipes" / "fleet"
SCRIPT = FOLDER / "simulate_fleet.py"


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


def commands():
    """Every command of the program that a file of the recipe runs, as its words."""
    service = (FOLDER / "slamreplay-watch.service").read_text(encoding="utf-8")
    yield next(line for line in service.splitlines() if line.startswith("ExecStart=")).split()[1:]
    for part in manifests():
        for container in pods(part):
            if container["args"][0] == "slamreplay":
                yield container["args"][1:]
    for line in (FOLDER / "slurm.sh").read_text(encoding="utf-8").splitlines():
        if line.strip().startswith("slamreplay "):
            yield line.split()[1:]


def manifests():
    return list(yaml.safe_load_all((FOLDER / "kubernetes.yaml").read_text(encoding="utf-8")))


def pods(part):
    """Every container below a part of the manifest."""
    if isinstance(part, dict):
        yield from part.get("containers", ())
        for value in part.values():
            yield from pods(value)


def test_the_program_has_every_option_that_the_recipe_gives():
    found = list(commands())

    assert [words[0] for words in found] == ["watch", "watch", "batch", "batch"]
    for name, *words in found:
        app = typer.Typer()
        import_module(f"slamreplay.cli.{name}").register(app)
        known = {o for p in typer.main.get_command(app).params for o in p.opts}
        assert {word for word in words if word.startswith("--")} <= known


def test_a_worker_of_kubernetes_may_have_what_its_pod_has():
    (worker,) = (c for part in manifests() for c in pods(part) if c["name"] == "worker")
    limit = worker["args"][worker["args"].index("--memory-limit") + 1]

    assert limit == worker["resources"]["limits"]["memory"] + "B"
    assert worker["args"][worker["args"].index("--nthreads") + 1] == "1"
    images = {c["image"] for part in manifests() for c in pods(part)}
    assert len(images) == 1  # one version on all sides


@pytest.fixture
def queue(tmp_path):
    """Runs an element of the array, with a program that tells its arguments and does no more."""
    program = tmp_path / "bin" / "slamreplay"
    program.parent.mkdir()
    program.write_text('#!/bin/sh\necho "$@"\n', encoding="utf-8")
    program.chmod(0o755)

    def run(*arguments, **env):
        path = f"{program.parent}:{os.environ['PATH']}"
        command = ["bash", str(FOLDER / "slurm.sh"), *map(str, arguments)]
        done = subprocess.run(command, capture_output=True, text=True, env={"PATH": path, **env})
        assert done.returncode == 0, done.stderr
        return done.stdout

    return run


@pytest.mark.parametrize(
    ("index", "size"),
    [
        ("SLURM_ARRAY_TASK_ID", "SLURM_ARRAY_TASK_COUNT"),
        ("AWS_BATCH_JOB_ARRAY_INDEX", "AWS_BATCH_JOB_ARRAY_SIZE"),
    ],
)
def test_elements_of_a_queue_share_a_manifest(queue, tmp_path, index, size):
    places = [f"/logs/{k}.mcap" for k in range(7)]
    manifest, out = tmp_path / "logs.txt", tmp_path / "out"
    manifest.write_text("\n".join(["# of today", *places[:3], "", *places[3:]]), encoding="utf-8")

    for k in range(3):
        said = queue(manifest, out, **{index: str(k), size: "3"})
        assert f"batch {out}/slices/{k}.txt --output {out}/slices/{k} " in said

    parts = [(out / "slices" / f"{k}.txt").read_text().split() for k in range(3)]
    assert [len(part) for part in parts] == [3, 2, 2]
    assert sorted(place for part in parts for place in part) == places


@pytest.mark.parametrize(
    ("again", "is_freed"),
    [
        ({}, False),
        ({"SLURM_RESTART_COUNT": "1"}, True),
        ({"AWS_BATCH_JOB_ATTEMPT": "1"}, False),
        ({"AWS_BATCH_JOB_ATTEMPT": "2"}, True),
    ],
)
def test_an_element_that_is_sent_again_is_not_held_up_by_its_own_lock(
    queue, tmp_path, again, is_freed
):
    (tmp_path / "logs.txt").write_text("/logs/a.mcap\n", encoding="utf-8")
    lock = tmp_path / "out" / "slices" / "0" / ".lock"
    lock.parent.mkdir(parents=True)
    lock.write_text('{"pid": 7, "host": "the-machine-that-died"}')

    queue(tmp_path / "logs.txt", tmp_path / "out", **again)

    assert lock.exists() != is_freed


def test_what_elements_made_is_joined_in_one_folder(queue, tmp_path):
    out = tmp_path / "out"
    for k in range(2):
        rows = [{"key": f"{k}{n}", "log": f"/logs/{k}{n}.mcap", "status": "done"} for n in range(3)]
        for row in rows:
            table = pa.Table.from_pylist([row], arrow_schema("logs"))
            commit(out / "slices" / str(k), {"logs": table})
            report = out / "slices" / str(k) / "logs" / row["key"]
            report.mkdir(parents=True)
            (report / "report.html").write_text(row["key"])
        (out / "slices" / str(k) / "batch.json").write_text('{"slamreplay": "batch", "version": 1}')

    for _ in range(2):  # and again, once one more element was done
        said = queue("--join", tmp_path / "logs.txt", out)

    assert said.startswith(f"batch {tmp_path}/logs.txt --output {out} ")
    with batch_folder(out):  # it is taken for one of a batch
        pass
    assert list((out / "maps").iterdir()) == []  # these logs had none
    assert len(read(out, "logs")) == 6
    assert len(list((out / "tables").iterdir())) == 6
    assert sorted(p.name for p in (out / "logs").iterdir()) == ["00", "01", "02", "10", "11", "12"]
    assert (out / "logs" / "12" / "report.html").read_text() == "12"


def test_tables_of_many_folders_are_read_by_one_pattern(tmp_path):
    import duckdb

    for k in range(3):
        row = {"key": f"{k}", "log": f"/logs/{k}.mcap", "status": "done"}
        commit(tmp_path / str(k), {"logs": pa.Table.from_pylist([row], arrow_schema("logs"))})

    found = duckdb.sql(f"select key from read_parquet('{tmp_path}/*/tables/*/logs.parquet')")
    assert sorted(found.fetchall()) == [("0",), ("1",), ("2",)]
