"""Scans and point clouds of the rarer types, as serialised by rosbags."""

import numpy as np
from payloads import read_back

from slamreplay.ingest.pipeline import ingest


def test_first_echo_of_each_beam_is_its_range_and_the_others_are_counted(logs):
    kind = "sensor_msgs/msg/MultiEchoLaserScan"
    echoes = ([1.5, 4.0, 9.0], [], [np.inf], [2.5])

    def make(ros):
        beams = [logs.make("sensor_msgs/msg/LaserEcho", ros, echoes=np.float32(e)) for e in echoes]
        values = {"angle_min": -1.0, "angle_increment": 0.5, "range_max": 30.0}
        whole = logs.make(kind, ros, header__frame_id="laser", ranges=beams, **values)
        half = logs.make(kind, ros, header__frame_id="laser", ranges=beams[2:], **values)
        still = logs.make(kind, ros, ranges=beams, range_max=30.0)
        return [whole, still, half]

    rows, told = read_back(logs, kind, make)

    assert rows.table == "scans"
    np.testing.assert_array_equal(
        rows.columns["ranges_m"][0], np.float32([1.5, np.nan, np.inf, 2.5])
    )
    np.testing.assert_array_equal(rows.columns["ranges_m"][1], np.float32([np.inf, 2.5]))
    assert told == {
        ("skipped", "further echoes of a beam"): 4,
        ("lost", "angle increment is zero"): 1,
    }


def test_a_log_with_a_multi_echo_laser_alone_has_a_scan(logs, tmp_path):
    kind = "sensor_msgs/msg/MultiEchoLaserScan"
    beams = [logs.make("sensor_msgs/msg/LaserEcho", echoes=np.float32([2.0, 3.0]))] * 8
    scans = [
        logs.make(kind, header__frame_id="laser", header__stamp__sec=100 + k, ranges=beams,
                  angle_increment=0.1, range_max=9.0)
        for k in range(3)
    ]  # fmt: skip
    messages = [("/echoes", kind, m, (100 + k) * 10**9) for k, m in enumerate(scans)]

    bundle = ingest([logs.write("log.mcap", messages)], tmp_path / "b")

    (role,) = bundle.manifest.roles
    assert (role.role, role.reason) == ("scan", "sensor_msgs/MultiEchoLaserScan, the only one")
    assert bundle.view().role("scan")["ranges_m"][0].tolist() == [2.0] * 8


def test_points_of_ros_1_lose_those_that_are_no_points(logs):
    kind = "sensor_msgs/msg/PointCloud"

    def make(ros):
        points = [
            logs.make("geometry_msgs/msg/Point32", ros, x=x, y=2.0, z=3.0)
            for x in (1.0, np.nan, 4.0)
        ]
        clouds = [points, [], points[2:]]
        return [logs.make(kind, ros, header__frame_id="/lidar", points=p) for p in clouds]

    rows, _ = read_back(logs, kind, make)

    assert [rows.columns["points_xyz"][k].tolist() for k in range(3)] == [
        [1, 2, 3, 4, 2, 3], [], [4, 2, 3],
    ]  # fmt: skip
    assert rows.frame() == "lidar"
