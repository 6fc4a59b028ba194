"""A reference whose frame the user knows the place of."""

import numpy as np
import pytest

from slamreplay.errors import UsageError
from slamreplay.geometry import se2, se3
from slamreplay.geometry.covariance import planar_from_ros, ros_from_planar, turned
from slamreplay.ingest.overrides import read_overrides
from slamreplay.ingest.placed_reference import placed_reference
from slamreplay.ingest.rows import TopicRows

PLACE = np.array([3.0, -2.0, np.radians(31.0)])
GIVEN = {"reference_in_map": "3.0 -2.0 31.0"}
COV = np.array([[0.04, 0.01, 0.004], [0.01, 0.09, -0.006], [0.004, -0.006, 0.01]])


def rows(kind="motion_capture", n=5):
    rng = np.random.default_rng(0)
    xyyaw = rng.uniform(-3.0, 3.0, (n, 3))
    columns = {
        "frame_id": np.full(n, "world", dtype=object),
        "child_frame_id": np.full(n, "base", dtype=object),
        "kind": np.full(n, kind, dtype=object),
        "position_xyz": np.column_stack([xyyaw[:, :2], np.full(n, 0.7)]),
        "orientation_xyzw": se3.quaternion_from_yaw(xyyaw[:, 2]),
        "covariance": ros_from_planar(np.tile(COV, (n, 1, 1))),
    }
    t = np.arange(n, dtype=np.int64)
    return TopicRows("/truth", "t", n, "references", columns, t, t), xyyaw


def test_poses_and_covariances_are_placed_and_told_of():
    topic, xyyaw = rows()
    placed, (told,) = placed_reference(topic, GIVEN, "map")
    at = placed.columns
    yaw = se3.yaw_from_quaternion(at["orientation_xyzw"])
    expected = se2.compose(PLACE, xyyaw)

    np.testing.assert_allclose(at["position_xyz"][:, :2], expected[:, :2], atol=1e-12)
    np.testing.assert_allclose(se2.wrap_angle(yaw - expected[:, 2]), 0.0, atol=1e-12)
    np.testing.assert_allclose(at["position_xyz"][:, 2], 0.7)
    np.testing.assert_allclose(
        planar_from_ros(at["covariance"]), turned(np.tile(COV, (5, 1, 1)), PLACE[2]), atol=1e-12
    )
    assert set(at["frame_id"]) == {"map"}
    assert (told.kind, told.count) == ("repaired", 5)
    assert "'world' lies at 3 m, -2 m, 31 deg" in told.reason


def test_what_the_robot_sensed_and_logs_without_the_key_stay_as_they_are():
    topic, _ = rows("fiducial")
    assert placed_reference(topic, GIVEN, "map") == (topic, [])
    topic, _ = rows()
    assert placed_reference(topic, {}, "map") == (topic, [])


@pytest.mark.parametrize(
    "text", ["[1, 2]", "[1, 2, three]", "15", "[1, 2, .nan]", "{x: 1}", "[1, 2, true]", "[]"]
)
def test_a_place_that_is_none_is_refused_in_one_line(tmp_path, text):
    file = tmp_path / "t.yaml"
    file.write_text(f"reference_in_map: {text}\n", encoding="utf-8")

    with pytest.raises(UsageError, match="reference_in_map") as refused:
        read_overrides(file)
    assert "15.0" in str(refused.value.hint)


def test_a_place_is_read_to_the_last_digit(tmp_path):
    file = tmp_path / "t.yaml"
    file.write_text("reference_in_map: [0.1, -2, 0.001]\n", encoding="utf-8")

    assert read_overrides(file) == {"reference_in_map": "0.1 -2.0 0.001"}
