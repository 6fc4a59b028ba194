"""Units, hands, quaternions and frames, confused: what a wrong driver tells."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from slamreplay.bundle.odometry import odometry_track, topic_track
from slamreplay.bundle.scans import scan_set
from slamreplay.bundle.tables import Table
from slamreplay.errors import NotApplicableError
from slamreplay.estimators.ekf.gyro import gyro_of
from slamreplay.geometry import se2, se3
from slamreplay.perturb import PERTURBATIONS
from slamreplay.testing.synthetic import MOUNT_XYYAW, synthetic_bundle

BUNDLE = synthetic_bundle(seconds=20.0, with_imu=True)
PLAIN = odometry_track(BUNDLE.view()).xyyaw


def perturbed(text: str, level: float = 1.0, view=None):
    name, _, variant = text.partition(".")
    rng = np.random.Generator(np.random.PCG64(0))
    return PERTURBATIONS.load(name)().apply(view or BUNDLE.view(), variant, level, rng)


#: What each makes of a path (N, 3).
PATHS = {
    "unit_error.odometry_mm_as_m": lambda p: p * [1000.0, 1000.0, 1.0],
    "unit_error.odometry_deg_as_rad": lambda p: p * [1.0, 1.0, 180.0 / np.pi],
    "unit_error.odometry_rad_as_deg": lambda p: p * [1.0, 1.0, np.pi / 180.0],
    "handedness.odometry": lambda p: p * [1.0, -1.0, -1.0],
    "handedness.odometry_y": lambda p: p * [1.0, -1.0, 1.0],
    "handedness.odometry_yaw": lambda p: p * [1.0, 1.0, -1.0],
    "quaternion_order.odometry": lambda p: p * [1.0, 1.0, 0.0],
    "quaternion_order.tf": lambda p: p * [1.0, 1.0, 0.0],
    "frame_swap.odometry": se2.inverse,
}


@pytest.mark.parametrize("text", PATHS)
def test_tf_and_topic_tell_odometry_as_the_wrong_convention_has_it(text):
    view = perturbed(text)
    expected = PATHS[text](PLAIN)

    told = [odometry_track(view).xyyaw]
    if not text.endswith("tf"):
        told.append(topic_track(view, view.table("odometry")).xyyaw)
    for xyyaw in told:
        np.testing.assert_allclose(xyyaw[:, :2], expected[:, :2], atol=1e-6)
        off = se2.wrap_angle(xyyaw[:, 2] - expected[:, 2])
        assert np.abs(off).max() < 1e-6


@pytest.mark.parametrize(
    "text", ["handedness.odometry", "handedness.odometry_y", "handedness.odometry_yaw"]
)
def test_what_was_mirrored_twice_is_as_it_was(text):
    twice = perturbed(text, view=perturbed(text))

    for name in ("odometry", "transforms"):
        for column in twice.table(name).schema.columns:
            if column.kind == "float64":
                before, after = (v.table(name)[column.name] for v in (BUNDLE.view(), twice))
                np.testing.assert_allclose(after, before, atol=1e-9)


def test_a_quaternion_told_with_w_first_is_the_rotation_that_scipy_makes_of_it():
    told = perturbed("quaternion_order.odometry").table("odometry")["orientation_xyzw"]

    right = Rotation.from_quat(BUNDLE.table("odometry")["orientation_xyzw"])
    wrong = Rotation.from_quat(right.as_quat(scalar_first=True))
    off = (Rotation.from_quat(told) * wrong.inv()).magnitude()
    assert off.max() < 1e-12


def test_a_level_laser_lies_on_its_back_when_all_of_tf_has_w_first():
    scans, plain = scan_set(perturbed("quaternion_order.tf")), scan_set(BUNDLE.view())

    np.testing.assert_array_equal(scans.angle_increment, -plain.angle_increment)


def test_an_initial_pose_told_in_degrees_or_with_w_first_looks_elsewhere():
    table = BUNDLE.table("initial_poses")
    yaw = se3.yaw_from_quaternion(table["orientation_xyzw"])

    degrees = perturbed("unit_error.start_deg_as_rad").table("initial_poses")
    first = perturbed("quaternion_order.initial_pose").table("initial_poses")

    off = se3.yaw_from_quaternion(degrees["orientation_xyzw"]) - np.degrees(yaw)
    np.testing.assert_allclose(se2.wrap_angle(off), 0.0, atol=1e-9)
    np.testing.assert_allclose(se3.yaw_from_quaternion(first["orientation_xyzw"]), 0.0, atol=1e-9)
    np.testing.assert_array_equal(degrees["position_xyz"], table["position_xyz"])


@pytest.mark.parametrize(
    ("text", "ratio"),
    [
        ("unit_error.imu_deg_as_rad", 180.0 / np.pi),
        ("unit_error.imu_rad_as_deg", np.pi / 180.0),
        ("handedness.imu_yaw", -1.0),
    ],
)
def test_a_gyroscope_tells_so_many_times_its_turns(text, ratio):
    rates = gyro_of(BUNDLE.view()).rate * ratio
    rates = rates[np.abs(rates) < 40.0]  # faster than any that an estimator believes

    np.testing.assert_allclose(gyro_of(perturbed(text)).rate, rates, atol=1e-9)


def test_a_mirrored_orientation_of_the_unit_turns_the_other_way():
    table = BUNDLE.table("imu")
    stated = np.tile(1e-4 * np.eye(3).ravel(), (len(table), 1))
    silent = np.full((len(table), 3), np.nan)
    view = BUNDLE.view().with_table(
        table.replace(angular_velocity_xyz=silent, orientation_covariance=stated)
    )
    one, other = gyro_of(view), gyro_of(perturbed("handedness.imu_yaw", view=view))
    np.testing.assert_allclose(other.turn, -one.turn, atol=1e-9)


def test_ranges_told_in_millimetres_are_beyond_the_laser():
    scans = perturbed("unit_error.scan_mm_as_m").table("scans")

    np.testing.assert_allclose(
        scans["ranges_m"].values, 1000.0 * BUNDLE.table("scans")["ranges_m"].values, rtol=1e-6
    )
    assert not scan_set(perturbed("unit_error.scan_mm_as_m")).hits.any()


def test_beams_told_from_the_last_to_the_first_are_mirrored_scan_by_scan():
    table = BUNDLE.table("scans")
    ragged = [np.arange(k % 5 + 1, dtype=np.float32) for k in range(len(table))]
    view = BUNDLE.view().with_table(table.replace(ranges_m=ragged))

    ranges = perturbed("handedness.scan_order", view=view).table("scans")["ranges_m"]

    for k, row in enumerate(ragged):
        np.testing.assert_array_equal(
            ranges.values[ranges.offsets[k] : ranges.offsets[k + 1]], row[::-1]
        )


def test_a_map_read_from_the_wrong_end_has_its_rows_mirrored():
    view = perturbed("handedness.map_rows")

    np.testing.assert_array_equal(view.grid.cells, BUNDLE.grid().cells[::-1])
    np.testing.assert_array_equal(view.grid.origin_xyyaw, BUNDLE.grid().origin_xyyaw)
    assert view.grid.version != BUNDLE.grid().version


def test_exchanged_frames_of_the_laser_invert_its_mount():
    mount = scan_set(perturbed("frame_swap.laser")).xyyaw_base_laser
    np.testing.assert_allclose(mount, se2.inverse(MOUNT_XYYAW), atol=1e-9)

    lost = scan_set(perturbed("frame_swap.scan_in_base")).xyyaw_base_laser
    np.testing.assert_allclose(lost, np.zeros(3), atol=1e-12)


def test_a_laser_above_the_base_is_exchanged_too():
    transforms = BUNDLE.table("transforms")
    own = transforms["child_frame"] == "laser"
    T = se3.inverse(se3.matrix(transforms["translation_xyz"], transforms["rotation_xyzw"]))[own]
    keep = transforms.take(~own)
    parent = keep["parent_frame"].copy()
    row = transforms.take(own).replace(
        parent_frame=np.array(["laser"], dtype=object),
        child_frame=np.array(["base_link"], dtype=object),
        translation_xyz=T[:, :3, 3],
        rotation_xyzw=se3.quaternion(T[:, :3, :3]),
    )
    keep = keep.take(parent != "odom")  # odometry would be the base's second parent
    view = BUNDLE.view().with_table(Table.concat(transforms.schema, [keep, row]))
    np.testing.assert_allclose(scan_set(view).xyyaw_base_laser, MOUNT_XYYAW, atol=1e-9)

    swapped = perturbed("frame_swap.laser", view=view)

    mount = scan_set(swapped).xyyaw_base_laser
    np.testing.assert_allclose(mount, se2.inverse(MOUNT_XYYAW), atol=1e-9)


def test_a_laser_on_the_base_has_no_frames_to_confuse():
    transforms = BUNDLE.table("transforms")
    rows = transforms["child_frame"] == "laser"
    xyz, turn = transforms["translation_xyz"].copy(), transforms["rotation_xyzw"].copy()
    xyz[rows], turn[rows] = 0.0, (0.0, 0.0, 0.0, 1.0)
    central = BUNDLE.view().with_table(transforms.replace(translation_xyz=xyz, rotation_xyzw=turn))
    with pytest.raises(NotApplicableError, match="nothing changes"):
        perturbed("frame_swap.laser", view=central)
    with pytest.raises(NotApplicableError, match="same in both"):
        perturbed("frame_swap.scan_in_base", view=central)
    with pytest.raises(NotApplicableError, match="where the laser is mounted"):
        perturbed("frame_swap.laser", view=BUNDLE.view().with_table(transforms.take(~rows)))


def test_what_a_log_does_not_have_cannot_be_confused():
    view = BUNDLE.view()
    for name in ("scans", "odometry", "transforms", "imu", "initial_poses"):
        view = view.with_table(Table.empty(BUNDLE.table(name).schema))
    for name in ("unit_error", "handedness", "quaternion_order", "frame_swap"):
        for variant in PERTURBATIONS.load(name).variants:
            if variant != "map_rows":
                with pytest.raises(NotApplicableError, match=r"no |nobody|empty"):
                    perturbed(f"{name}.{variant}", view=view)
    bare = synthetic_bundle(seconds=1.0, with_map=False).view()
    with pytest.raises(NotApplicableError, match="no map"):
        perturbed("handedness.map_rows", view=bare)
