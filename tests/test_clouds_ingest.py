"""Logs with clouds instead of a laser, from the file to the bundle and to the verdict."""

import dataclasses
import json

import numpy as np
import pytest
from layered_lidar import (
    FRAME,
    TOPIC,
    DepthCamera,
    LayeredLidar,
    cloud_message,
    cloud_records,
    mount,
)

from slamreplay.errors import LogError, UsageError
from slamreplay.geometry import se2
from slamreplay.ingest.clouds.reading import cloud_batches
from slamreplay.ingest.options import IngestOptions
from slamreplay.ingest.pipeline import ingest
from slamreplay.ingest.readers import windows
from slamreplay.ingest.readers.open_log import open_log
from slamreplay.maps.raycast import cast_rays
from slamreplay.postmortem import postmortem
from slamreplay.report.build import build
from slamreplay.simulate.drive import Follow, Pause, Spin
from slamreplay.simulate.recording import record
from slamreplay.simulate.scenarios import Scenario
from slamreplay.simulate.topics import START_NS, Record, records
from slamreplay.simulate.worlds import box, warehouse
from slamreplay.simulate.writer import _CHUNK_BYTES, write_log

LIDAR = LayeredLidar(
    elevations=np.radians(np.arange(-14.0, 8.0, 2.0)),
    azimuths=np.radians(np.arange(0.0, -360.0, -0.5)),
    sigma_m=0.01,
)


@pytest.fixture(scope="module")
def short():
    """A robot that drives four metres and turns, its laser at work."""
    hall = warehouse()
    tour = (Pause(0.4), Follow(((5.5, 1.2),)), Spin(1.0))
    return record(Scenario(hall, hall, (1.5, 1.3, 0.0), tour, "healthy", 5))


@pytest.fixture(scope="module")
def log(short, tmp_path_factory):
    """Its log, clouds in the laser's place."""
    path = tmp_path_factory.mktemp("clouds") / "clouds.mcap"
    write_log(path, lambda messages: cloud_records(short, messages, LIDAR))
    return path


@pytest.fixture(scope="module")
def bundle(log):
    return ingest([log], log.with_suffix(".bundle"))


def losses(bundle):
    return {(x.kind, x.what, x.reason): x.count for x in bundle.manifest.losses}


def role(bundle, name):
    return next((r for r in bundle.manifest.roles if r.role == name), None)


def ranges(bundle):
    column = bundle.view().role("scan")["ranges_m"]
    return column.values.reshape(len(column), -1)


def topics_file(path, text):
    path.write_text(text, encoding="utf-8")
    return IngestOptions(topics=path)


def test_a_cloud_plays_the_scan_where_there_is_no_laser(bundle, short):
    chosen, table = role(bundle, "scan"), bundle.view().role("scan")

    assert (chosen.topic, chosen.type) == (TOPIC, "sensor_msgs/msg/PointCloud2")
    for words in ("the only cloud", "0.20 to 1.00 m above the floor", "motion", "taken out"):
        assert words in chosen.reason
    assert len(table) == chosen.messages > 50
    assert set(table["time_increment_s"]) == {0.0}  # nobody deskews them again
    assert set(table["frame_id"]) == {f"{FRAME}_level"}
    assert "scans" not in bundle.manifest.missing_parts()
    assert len(bundle.table("points")) == 0
    assert bundle.manifest.clock.name == "sensor"


def test_rays_start_at_the_sensor_in_a_level_frame(bundle):
    edge = next(e for e in bundle.manifest.frames.tree if e.child == f"{FRAME}_level")
    T, valid = bundle.view().transforms.lookup("base_link", edge.child, np.array([START_NS]))

    assert (edge.parent, edge.is_static) == ("base_link", True)
    assert valid.all()
    np.testing.assert_allclose(T[0, :3, 3], LIDAR.T_base_sensor[:3, 3])
    np.testing.assert_allclose(T[0, :3, :3], np.eye(3))


def test_scans_are_those_of_a_laser_at_the_sensor(bundle, short):
    table = bundle.view().role("scan")
    base = short.motion.poses_at((table.t_ns - START_NS) / 1e9)
    sensor = se2.compose(base, np.append(LIDAR.T_base_sensor[:2, 3], 0.0))
    bearings = table["angle_min_rad"][0] + np.arange(720) * table["angle_increment_rad"][0]
    expected = cast_rays(short.standing, sensor, bearings, LIDAR.range_max_m)

    off = np.abs(ranges(bundle) - expected)

    assert np.mean(off[np.isfinite(off)] < 0.03) > 0.95  # by odometry, not by the truth


def test_the_same_log_gives_the_same_bundle(log, bundle, tmp_path):
    again = ingest([log], tmp_path / "again.bundle")

    assert again.manifest.bundle_id == bundle.manifest.bundle_id


@pytest.mark.parametrize("suffix", [".bag", ".db3"])
def test_other_containers_tell_the_same(short, bundle, tmp_path, suffix):
    path = tmp_path / f"clouds{suffix}"
    write_log(path, lambda messages: cloud_records(short, messages, LIDAR))

    np.testing.assert_array_equal(ranges(ingest([path], tmp_path / "other.bundle")), ranges(bundle))


def test_batches_of_any_size_tell_the_same(log, bundle, tmp_path, monkeypatch):
    monkeypatch.setattr(windows, "WINDOW_BYTES", 2_000_000)

    few = ingest([log], tmp_path / "few.bundle")

    off = np.abs(ranges(few) - ranges(bundle))
    # Floor and density are told by the first batch, so they differ by a hair.
    assert np.mean(off[np.isfinite(off)] < 0.005) > 0.98


def test_at_most_one_batch_is_in_memory(log, monkeypatch):
    monkeypatch.setattr(windows, "WINDOW_BYTES", 1_000_000)
    with open_log([log]) as (readers, _):
        sizes = [len(c.xyz[0]) for c in cloud_batches(readers, TOPIC, [], lambda _: None)]

    point, cloud = 16, len(LIDAR.elevations) * len(LIDAR.azimuths)
    assert len(sizes) > 2
    assert max(sizes) * point < 1_000_000 + _CHUNK_BYTES + 2 * cloud * point


@pytest.fixture(scope="module")
def with_laser(short, tmp_path_factory):
    path = tmp_path_factory.mktemp("both") / "both.mcap"
    write_log(path, lambda messages: cloud_records(short, messages, LIDAR, laser_too=True))
    return path


def test_beside_a_laser_clouds_are_not_read(with_laser, tmp_path):
    both = ingest([with_laser], tmp_path / "both.bundle")

    assert role(both, "scan").topic == "/scan"
    skipped = [k for k in losses(both) if k[1].startswith(TOPIC)]
    assert [(kind, "/scan is used" in reason) for kind, _, reason in skipped] == [("skipped", True)]
    assert len(both.table("points")) == 0


def test_the_topics_file_has_clouds_flattened_beside_a_laser(with_laser, tmp_path):
    options = topics_file(tmp_path / "t.yaml", f"scan: {TOPIC}\nscan_band_m: [0.3, 0.8]\n")

    forced = ingest([with_laser], tmp_path / "forced.bundle", options)

    assert role(forced, "scan").topic == TOPIC
    assert role(forced, "scan_2") is None
    assert "0.30 to 0.80 m" in role(forced, "scan").reason
    assert set(forced.view().role("scan")["frame_id"]) == {f"{FRAME}_level"}


def test_the_topics_file_has_points_kept(with_laser, log, tmp_path):
    options = topics_file(tmp_path / "t.yaml", f"points: {TOPIC}\n")

    beside = ingest([with_laser], tmp_path / "beside.bundle", options)
    alone = ingest([log], tmp_path / "alone.bundle", options)

    assert role(beside, "scan").topic == "/scan"
    assert role(alone, "scan").topic == TOPIC
    for kept in (beside, alone):
        points = kept.view().role("points")["points_xyz"]
        assert len(points) == role(kept, "points").messages
        assert 1000 < np.median(points.lengths) / 3 < 0.8 * LIDAR.azimuths.size * 11
        assert not [k for k in losses(kept) if "not read" in k[2]]


@pytest.mark.parametrize("text", ["[1.0, 0.2]", "0.5", "[0.2]", "[a, b]"])
def test_a_band_that_is_none_is_refused(log, tmp_path, text):
    options = topics_file(tmp_path / "t.yaml", f"scan_band_m: {text}\n")

    with pytest.raises(UsageError, match="two heights"):
        ingest([log], tmp_path / "x.bundle", options)


def test_clouds_without_times_are_left_as_swept(short, tmp_path):
    path = tmp_path / "swept.mcap"
    write_log(path, lambda messages: cloud_records(short, messages, LIDAR, time=None))

    swept = ingest([path], tmp_path / "swept.bundle")

    assert "as swept" in role(swept, "scan").reason
    (reason,) = [k[2] for k in losses(swept) if k[1] == TOPIC]
    assert reason == "motion within a sweep is not taken out: its points carry no time"


def test_of_several_clouds_the_widest_is_flattened(short, tmp_path):
    camera = DepthCamera()

    def both(messages):
        made = cloud_records(short, messages, LIDAR)
        looked = [r for r in cloud_records(short, messages, camera) if r.topic == TOPIC]
        seen = [dataclasses.replace(r, topic="/camera/points") for r in looked]
        for r in seen:
            r.message.header.frame_id = "camera_optical_frame"
        chart = cloud_message(messages.make, messages.header(START_NS, "map"), np.ones((9, 3)))
        chart = Record(START_NS + 10**7, "/a_map", "sensor_msgs/PointCloud2", chart)
        return sorted([*made, *seen, chart], key=lambda r: r.t_log_ns)

    path = tmp_path / "several.mcap"
    write_log(path, both)

    several = ingest([path], tmp_path / "several.bundle")

    assert role(several, "scan").topic == TOPIC
    assert "the best of 3 clouds: 3" in role(several, "scan").reason
    for name in ("/a_map", "/camera/points"):
        (reason,) = [k[2] for k in losses(several) if k[1].startswith(name)]
        assert reason == f"{TOPIC} is used instead"


def test_a_camera_alone_is_flattened_as_far_as_it_sees(short, tmp_path):
    path = tmp_path / "camera.mcap"
    write_log(path, lambda messages: cloud_records(short, messages, DepthCamera(), time=None))

    seen = ingest([path], tmp_path / "camera.bundle")

    assert ranges(seen).shape[1] < 120
    assert np.isfinite(ranges(seen)).mean() > 0.4
    assert not np.isposinf(ranges(seen)).any()


def test_clouds_that_cannot_be_read_are_counted(short, tmp_path):
    def broken(messages):
        made = cloud_records(short, messages, LIDAR)
        clouds = [r for r in made if r.topic == TOPIC]
        clouds[3].message.data = clouds[3].message.data[:100]
        clouds[7].message.fields = clouds[7].message.fields[1:]
        clouds[9].message.header.frame_id = "elsewhere"
        return made

    path = tmp_path / "broken.mcap"
    write_log(path, broken)

    told = ingest([path], tmp_path / "broken.bundle")

    lost = {reason: count for (kind, what, reason), count in losses(told).items() if kind == "lost"}
    assert lost == {
        "no x y z fields, or fewer bytes than said": 2,
        f"not in {FRAME} as the others are": 1,
    }


def test_damage_of_the_file_is_told_once(log, tmp_path):
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(log.read_bytes()[: int(0.6 * log.stat().st_size)])

    told = ingest([cut], tmp_path / "cut.bundle")

    with open_log([cut]) as (readers, _):
        (reader,) = readers
        assert sum(len(block) for block in reader.blocks({0}))
        (loss,) = [x for x in reader.losses if x.kind == "lost"]
    assert losses(told)[loss.kind, loss.what, loss.reason] == loss.count
    assert 10 < len(told.view().role("scan")) < 80


def test_files_of_one_log_in_the_wrong_order_tell_the_same(short, bundle, tmp_path):
    def part(first, last):
        def of(messages):
            every = cloud_records(short, messages, LIDAR)
            return every[int(first * len(every)) : int(last * len(every))]

        return of

    for name, span in (("a", (0.0, 0.5)), ("b", (0.5, 1.0))):
        write_log(tmp_path / f"{name}.mcap", part(*span))

    split = ingest([tmp_path / "b.mcap", tmp_path / "a.mcap"], tmp_path / "split.bundle")

    table = split.view().role("scan")
    assert table.t_ns.tolist() == bundle.view().role("scan").t_ns.tolist()
    off = np.abs(ranges(split) - ranges(bundle))
    assert np.mean(off[np.isfinite(off)] < 0.005) > 0.95


def test_clouds_alone_make_a_bundle(short, tmp_path):
    """Nothing but clouds: no tf, no odometry, no clock but theirs."""
    path = tmp_path / "alone.mcap"
    write_log(
        path,
        lambda messages: [r for r in cloud_records(short, messages, LIDAR) if r.topic == TOPIC],
    )

    alone = ingest([path], tmp_path / "alone.bundle")

    assert alone.manifest.clock.name == "sensor"
    assert set(alone.view().role("scan")["frame_id"]) == {FRAME}
    # The sensor is not on tf, yet its height above the floor shows.
    assert "0.55 m below lidar" in role(alone, "scan").reason
    assert np.isfinite(ranges(alone)).mean() > 0.95


def test_a_log_with_a_useless_cloud_alone_has_nothing_to_work_with(tmp_path):
    def chart(messages):
        cloud = cloud_message(messages.make, messages.header(START_NS, "map"), np.ones((9, 3)))
        return [Record(START_NS, "/a_map", "sensor_msgs/PointCloud2", cloud)]

    path = tmp_path / "map.mcap"
    write_log(path, chart)

    with pytest.raises(LogError, match="nothing to work with"):
        ingest([path], tmp_path / "map.bundle")


def test_a_robots_namespace_is_stripped_off_frames_of_clouds(short, tmp_path):
    def named(messages):
        made = []
        for r in cloud_records(short, messages, LIDAR):
            if r.topic == TOPIC:
                r.message.header.frame_id = f"r1/{FRAME}"
                r = dataclasses.replace(r, topic=f"/r1{TOPIC}")
            made.append(r)
        return made

    path = tmp_path / "named.mcap"
    write_log(path, named)

    told = ingest([path], tmp_path / "named.bundle", IngestOptions(robot="r1"))

    assert role(told, "scan").topic == f"/r1{TOPIC}"
    assert set(told.view().role("scan")["frame_id"]) == {f"{FRAME}_level"}


def test_an_incident_gets_the_same_verdict_from_a_laser_and_from_a_cloud(tmp_path):
    """Lost from the start in a hall where an aisle is blocked."""
    hall = warehouse()
    pallets = (box("pallets", 6.1, 3.6, 1.0, 2.0), box("more pallets", 13.4, 3.2, 0.8, 1.6))
    there = hall.changed(without=("rack a2",), added=pallets)
    tour = (Pause(1.0), Follow(((12.0, 1.2), (15.3, 1.4), (15.3, 4.6), (13.6, 6.0))), Pause(1.0))
    incident = record(
        Scenario(hall, there, (1.5, 1.3, 0.0), tour, "lost_and_map_changed", 8,
                 believed_start=(2.3, 8.2, -0.25))
    )  # fmt: skip
    told = {}
    makers = {
        "laser": lambda messages: records(incident, messages),
        "cloud": lambda messages: cloud_records(incident, messages, LIDAR),
    }
    for name, make in makers.items():
        path = tmp_path / f"{name}.mcap"
        write_log(path, make)
        post = postmortem(ingest([path], tmp_path / f"{name}.bundle"))
        told[name] = json.loads(build(post).json_text())

    laser, cloud = told["laser"], told["cloud"]
    assert laser["verdict"]["state"] == cloud["verdict"]["state"] == incident.scenario.verdict
    assert laser["failure_mode"]["kind"] == cloud["failure_mode"]["kind"]
    kinds = [sorted({r["kind"] for r in told[n]["changed_regions"]}) for n in told]
    assert kinds[0] == kinds[1] == ["appeared", "removed"]
    assert cloud["reference"]["coverage"] > 0.95


def test_the_mount_of_the_tests_is_what_tf_says(bundle):
    T, _ = bundle.view().transforms.lookup("base_link", FRAME, np.array([START_NS]))

    np.testing.assert_allclose(T[0], mount(), atol=1e-9)
