"""What a localizer says of itself in a single number, known by its topic's name."""

import numpy as np
import pytest
from payloads import read_back

from slamreplay.ingest.names import is_quality
from slamreplay.ingest.options import IngestOptions
from slamreplay.ingest.pipeline import ingest

SECOND = 10**9
EPOCH = 1_700_000_000 * SECOND
FLOAT, VECTOR = "std_msgs/msg/Float32", "geometry_msgs/msg/Vector3Stamped"
AUTOWARE = "autoware_internal_debug_msgs/msg/Float32Stamped"
ODOM = "nav_msgs/msg/Odometry"


@pytest.mark.parametrize("kind", [FLOAT, "std_msgs/msg/Float64"])
def test_a_number_carries_its_topics_name(logs, kind):
    rows, _ = read_back(logs, kind, lambda ros: [logs.make(kind, ros, data=0.25)], topic="/r/alpha")

    assert (rows.table, rows.columns["name"].tolist()) == ("signals", ["alpha"])
    assert rows.columns["value"].tolist() == [0.25]


@pytest.mark.parametrize("kind", [AUTOWARE, "tier4_debug_msgs/msg/Float32Stamped"])
def test_autowares_numbers_carry_their_stamp(logs, kind):
    def make(ros):
        return [logs.make(kind, ros, stamp__sec=7, data=3.5)]

    rows, _ = read_back(logs, kind, make, topic="/localization/transform_probability")

    assert rows.columns["name"].tolist() == ["transform_probability"]
    assert (rows.columns["value"].tolist(), rows.t_sensor_ns.tolist()) == ([3.5], [7 * SECOND])


def test_als_ros_puts_three_numbers_into_its_reliability(logs):
    def make(ros):
        values = {"vector__x": 0.9, "vector__y": 0.1, "vector__z": 0.3}
        return [logs.make(VECTOR, ros, header__stamp__sec=1, **values)]

    rows, _ = read_back(logs, VECTOR, make, topic="/reliability")

    names = ["reliability", "mean_absolute_error", "mean_absolute_error_threshold"]
    assert rows.columns["name"].tolist() == names
    assert rows.columns["value"].tolist() == [0.9, 0.1, 0.3]
    assert rows.t_sensor_ns.tolist() == [SECOND] * 3


def test_a_failure_probability_that_could_not_be_told_is_counted(logs):
    def make(ros):
        return [logs.make(VECTOR, ros, vector__x=x) for x in (0.75, -1.0, 0.5)]

    rows, told = read_back(logs, VECTOR, make, topic="/failure_probability")

    assert rows.columns["name"].tolist() == ["failure_probability"] * 2
    assert rows.columns["value"].tolist() == [0.75, 0.5]
    assert told == {("skipped", "told as -1: too few beams to judge"): 1}


@pytest.mark.parametrize(
    ("topic", "is_score"),
    [("/alpha", True), ("/robot1/reliability", True), ("/ndt/fitness_score", True),
     ("/localization_confidence", True), ("/slam/matchQuality", True),
     ("/failure_probability", True), ("/battery/quality", False), ("/detector/score", False),
     ("/temperature", False), ("/alphabet", False), ("/localization/exe_time_ms", False)],
)  # fmt: skip
def test_names_of_scores(topic, is_score):
    assert is_quality(topic) == is_score


@pytest.fixture
def log(logs):
    """Odometry, two scores, a temperature and a vector."""
    messages = []
    for k in range(4):
        t = EPOCH + k * SECOND
        stamp = {"header__stamp__sec": t // SECOND}
        odometry = logs.make(ODOM, header__frame_id="odom", child_frame_id="base_link",
                             pose__pose__orientation__w=1.0, **stamp)  # fmt: skip
        score = logs.make(AUTOWARE, stamp__sec=t // SECOND, data=2.5)
        messages += [
            ("/odom", ODOM, odometry, t),
            ("/temperature", FLOAT, logs.make(FLOAT, data=20.0), t),
            ("/alpha", FLOAT, logs.make(FLOAT, data=0.1 * k), t),
            ("/gravity", VECTOR, logs.make(VECTOR, **stamp), t),
            ("/pose_estimator/transform_probability", AUTOWARE, score, t),
        ]
    return logs.write("log.mcap", messages)


def test_scores_are_kept_and_other_numbers_told_of(log, tmp_path):
    bundle = ingest([log], tmp_path / "b")

    (role,) = [r for r in bundle.manifest.roles if r.role == "quality"]
    assert role.topic == "/pose_estimator/transform_probability"
    signals = bundle.table("signals")
    assert set(signals["topic"]) == {"/alpha", "/pose_estimator/transform_probability"}
    alpha = signals.take(signals["topic"] == "/alpha")
    assert alpha.t_ns.tolist() == [EPOCH + k * SECOND for k in range(4)]
    skipped = {x.what: (x.count, x.reason) for x in bundle.manifest.losses}
    reason = "by its name no localisation score"
    assert skipped["/temperature (std_msgs/msg/Float32)"] == (4, reason)
    assert skipped["/gravity (geometry_msgs/msg/Vector3Stamped)"] == (4, reason)
    assert len(skipped) == 2


def test_a_score_under_an_odd_name_can_be_named(log, tmp_path):
    topics = tmp_path / "topics.yaml"
    topics.write_text("quality: /temperature\n")

    bundle = ingest([log], tmp_path / "b", IngestOptions(topics=topics))

    np.testing.assert_array_equal(bundle.view().role("quality")["value"], [20.0] * 4)
