"""`export --redact`: no name is left in any byte, and the log says the same."""

import json
from pathlib import Path

import numpy as np
import pytest
import typer
from export_logs import SECRET, everything
from mcap.reader import make_reader
from typer.testing import CliRunner

from slamreplay.bundle.manifest import Loss, Missing
from slamreplay.bundle.run import Estimate, Innovations, Run, Trial
from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import Bundle
from slamreplay.cli import export
from slamreplay.export.pseudonyms import Pseudonyms
from slamreplay.export.redaction import Redactor
from slamreplay.export.said_again import said_again
from slamreplay.ingest.pipeline import ingest
from slamreplay.postmortem import postmortem
from slamreplay.verdict.motion import protections

LOST = Path(__file__).resolve().parents[1] / "sample_logs" / "lost_robot.mcap"


@pytest.fixture(scope="module")
def bundle(tmp_path_factory, logs_in):
    """A log whose every name says whose it is."""
    folder = tmp_path_factory.mktemp("log")
    log = everything(logs_in(folder), robot=f"/{SECRET}_7", frame=f"{SECRET}_7/")
    return ingest([log], folder / f"{SECRET}.bundle")


def call(*arguments):
    app = typer.Typer()
    export.register(app)
    return CliRunner().invoke(app, [*map(str, arguments)], catch_exceptions=False)


def contents(folder):
    """All bytes of a folder's files with their names, compressed parts unpacked."""
    for file in sorted(folder.rglob("*")):
        if not file.is_file():
            continue
        yield file.name.encode()
        yield file.read_bytes()
        if file.suffix == ".mcap":
            with file.open("rb") as stream:
                reader = make_reader(stream)
                summary = reader.get_summary()
                yield repr((summary.schemas, summary.channels)).encode()
                for _, _, message in reader.iter_messages():
                    yield message.data
                for attachment in reader.iter_attachments():
                    yield attachment.name.encode() + attachment.data
                yield repr(list(reader.iter_metadata())).encode()


@pytest.mark.parametrize(
    "to",
    [("mcap",), ("tum", "--covariance"), ("csv", "--only", "recorded")],
)
def test_nothing_that_identifies_is_left(bundle, tmp_path, to):
    ran = call(bundle.path, "--to", *to, "--redact", "--json", "-o", tmp_path / "out")
    assert ran.exit_code == 0, ran.output
    found = [c for c in contents(tmp_path / "out") if SECRET.encode() in c.lower()]
    assert found == []
    assert SECRET not in json.dumps(json.loads(ran.stdout)["files"])
    assert json.loads((tmp_path / "out" / "export.json").read_text())["redacted"] is True
    plain = call(bundle.path, "--to", *to, "-o", tmp_path / "plain")
    assert plain.exit_code == 0
    assert any(SECRET.encode() in c.lower() for c in contents(tmp_path / "plain"))


def test_no_text_of_the_manifest_is_left(bundle):
    old = bundle.manifest
    told = {
        "sources": [s.model_copy(update={"name": f"{SECRET}.mcap"}) for s in old.sources],
        "options": {"map": f"{SECRET}.yaml", "robot": SECRET},
        "clock": old.clock.model_copy(update={"reason": SECRET}),
        "roles": [
            *(r.model_copy(update={"reason": SECRET}) for r in old.roles),
            old.roles[0].model_copy(update={"role": "points", "type": f"{SECRET}_msgs/msg/Eye"}),
        ],
        "missing": [Missing(part="imu", reason=f"/{SECRET}/imu is empty", consequence="none")],
        "maps": [m.model_copy(update={"source": f"{SECRET}.yaml"}) for m in old.maps],
        "losses": [
            Loss(kind="lost", what=what, count=1, reason=SECRET)
            for what in (f"/{SECRET}/scan: its end", f"{SECRET}.mcap")
        ],
    }
    secret = Bundle(
        old.model_copy(update=told), {n: bundle.table(n) for n in TABLES}, bundle.grids()
    )

    new = Redactor(secret).bundle().manifest
    assert [r.type for r in new.roles[:-1]] == [r.type for r in old.roles]
    text = new.model_dump_json()
    assert SECRET not in text
    assert "lost" in text


def test_a_redacted_log_is_read_as_the_log_was(bundle, tmp_path):
    call(bundle.path, "--to", "mcap", "--only", "recorded", "--redact", "-o", tmp_path / "out")
    again = ingest([tmp_path / "out" / "recorded.mcap"], tmp_path / "again")

    role_of = {r.role: r.topic for r in again.manifest.roles}
    assert set(role_of) == {r.role for r in bundle.manifest.roles}
    assert role_of["scan"] == "/robot_1/scan"
    assert again.manifest.frames.base == "robot_1/base_link"
    for name in TABLES:
        a, b = bundle.table(name), again.table(name)
        assert len(a) == len(b), name
        for column in a.schema.columns:
            if column.kind == "float64":
                np.testing.assert_allclose(a[column.name], b[column.name], rtol=1e-9, atol=1e-9)
    # What the verdict reads in texts: recoveries, batteries' states, safety stops.
    assert set(again.table("recoveries")["source"]) == set(bundle.table("recoveries")["source"])
    whole = bundle.manifest.start_ns, bundle.manifest.end_ns
    assert "emergency" in protections(bundle.view(), *whole)
    assert "emergency" in protections(again.view(), *whole)


def test_a_redacted_cut_round_the_incident_gives_the_same_verdict(tmp_path):
    call(LOST, "--to", "mcap", "--only", "recorded", "--redact", "--start", 14, "--end", 26,
         "-o", tmp_path / "out")  # fmt: skip
    cut = ingest([tmp_path / "out" / "recorded.mcap"], tmp_path / "cut")
    assert postmortem(cut, cause=False).judgement.state == "lost"


def test_the_redacted_bundle_is_whole_without_the_log(bundle):
    redacted = Redactor(bundle).bundle()
    assert SECRET not in redacted.manifest.model_dump_json()
    assert redacted.manifest.sources[0].sha256 == ""
    assert redacted.view().grid is not None
    assert redacted.view().map_course[0].version == redacted.manifest.maps[0].version
    assert redacted.view().transforms.has_path("robot_1/map", "robot_1/laser")


def test_runs_are_redacted_with_the_bundle(bundle):
    track = PoseTrack.without_covariance(
        f"{SECRET}_7/map", f"{SECRET}_7/base_link", np.array([1]), np.zeros((1, 3))
    )
    measured = (np.array([1]), np.zeros((1, 2)), np.eye(2)[None], np.array([True]))
    about = np.array([f"{SECRET}_7/laser"])
    told = Innovations("scans", *measured, frame_id=f"{SECRET}_7/map", about=about)
    parameters = json.dumps({"scan_topic": f"/{SECRET}_7/scan"})
    run = Run(Trial("id", "amcl", 0, parameters=parameters), Estimate(track, (told,)))
    redactor = Redactor(bundle)
    redactor.bundle()
    new = redactor.run(run)
    assert new.estimate.track.frame_id == "robot_1/map"
    assert SECRET not in f"{new.trial} {new.estimate.innovations[0].about}"
    assert new.trial.given == {"scan_topic": "/robot_1/scan"}


@pytest.mark.parametrize(
    ("name", "new"),
    [
        ("/scan", "/scan"),
        ("/tf_static", "/tf_static"),
        ("/local_costmap/costmap_updates", "/local_costmap/costmap_updates"),
        ("/spin/_action/status", "/spin/_action/status"),
        ("/laser_2/scan", "/robot_1_laser/scan"),  # a number of a space may be a robot's
        ("/scan_2", "/scan_2"),
        ("/scan_4711", "/topic_1_scan"),
        ("/acme/hall3_lidar", "/robot_1/topic_1_lidar"),
        ("/Lagerhalle/Süd", "/robot_1/topic_1"),
        ("/acmeScan", "/topic_1_scan"),
    ],
)
def test_names_keep_what_they_mean(name, new):
    assert Pseudonyms().topic(name) == new


def test_a_name_is_the_same_wherever_it_occurs():
    names = Pseudonyms()
    assert names.topic("/acme7/odom") == "/robot_1/odom"
    assert names.frame("acme7/base_link") == "robot_1/base_link"
    assert names.frame("tag_1234") == "tag_1234"
    assert names.phrase("acme7: planner", "node") == "node_1 planner"
    assert names.text("lost at acme7 (acme7/base_link)") == "lost at robot_1 (robot_1/base_link)"


@pytest.mark.parametrize(
    ("node", "line", "again"),
    [
        ("behavior_server", "Running acme_spin", "Running action_1_spin"),
        ("behavior_server", "acme_spin failed at shelf 3", "action_1_spin failed"),
        (
            "x.bt_navigator",
            "Begin navigating from current location (1, 2) to (3, 4)",
            "Begin navigating from current location",
        ),
        ("x.bt_navigator", "Goal succeeded", "Goal succeeded"),
        (
            "costmap",
            "Received request to clear entirely the acme_local_costmap",
            "Received request to clear action_1_local_costmap",
        ),
        ("move_base", "Rotate recovery behavior started.", "rotate recovery behavior started"),
        ("acme", "the parcel 4711 is late", None),
    ],
)
def test_lines_of_recoveries_are_said_again(node, line, again):
    names = Pseudonyms()
    new_node = names.phrase(node, "node")
    assert said_again(node, line, new_node, lambda n: names.phrase(n, "action")) == again
