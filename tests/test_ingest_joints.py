"""Joints and magnetometers: what is not told is not a number."""

import numpy as np
from payloads import read_back

JOINTS, FIELD = "sensor_msgs/msg/JointState", "sensor_msgs/msg/MagneticField"


def test_joints_are_rows_and_what_is_not_told_is_nan(logs):
    lists = [
        (["left", "right"], [1.0, 2.0], [3.0, 4.0], []),
        ([], [], [], []),
        (["arm"], [], [5.0], [6.0]),
        (["left", "right"], [7.0], [8.0, 9.0, 10.0], []),
    ]

    def make(ros):
        names = ("name", "position", "velocity", "effort")
        return [
            logs.make(JOINTS, ros, header__stamp__sec=k + 1, **dict(zip(names, row, strict=True)))
            for k, row in enumerate(
                (n, *(np.array(v, dtype=float) for v in values)) for n, *values in lists
            )
        ]

    rows, told = read_back(logs, JOINTS, make)

    nan = np.nan
    assert rows.columns["name"].tolist() == ["left", "right", "arm", "left", "right"]
    np.testing.assert_array_equal(rows.columns["position"], [1, 2, nan, 7, nan])
    np.testing.assert_array_equal(rows.columns["velocity"], [3, 4, 5, 8, 9])
    np.testing.assert_array_equal(rows.columns["effort"], [nan, nan, 6, nan, nan])
    assert (rows.t_sensor_ns // 10**9).tolist() == [1, 1, 3, 4, 4]
    assert told == {("repaired", "values do not fit the joints' names in number"): 1}


def test_a_magnetic_covariance_of_zeros_is_not_known(logs):
    def make(ros):
        values = {"magnetic_field__x": 2e-5, "magnetic_field__z": float("nan")}
        known = {"magnetic_field_covariance": np.arange(9.0)}
        return [logs.make(FIELD, ros, **values), logs.make(FIELD, ros, **values, **known)]

    rows, told = read_back(logs, FIELD, make)

    np.testing.assert_array_equal(rows.columns["magnetic_field_xyz"], [[2e-5, 0.0, np.nan]] * 2)
    assert np.isnan(rows.columns["magnetic_field_covariance"][0]).all()
    assert rows.columns["magnetic_field_covariance"][1].tolist() == list(range(9))
    assert not told


def test_wheels_of_a_real_robot_are_read_to_the_last_joint(real_logs):
    from slamreplay.ingest.readers.open_log import open_log
    from slamreplay.ingest.reading import read_rows

    with open_log([real_logs / "fixtures/turtlebot3_no_tf.bag"]) as (readers, _):
        rows, _ = read_rows(readers, lambda t: None if t == "/joint_states" else "not asked", None)

    (joints,) = rows
    assert len(joints) == 2 * joints.messages
    assert np.isfinite(joints.columns["position"]).all()
