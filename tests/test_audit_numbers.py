"""Lasers whose numbers do not fit, and what is said of placeholders."""

import numpy as np
import pytest
from audited import findings, healthy, with_manifest

from slamreplay.audit.lasers import laser_numbers
from slamreplay.bundle.manifest import ODD_ANGLES, Loss
from slamreplay.bundle.tables import Ragged
from slamreplay.consistency import CHECKS
from slamreplay.consistency.context import CheckContext
from slamreplay.geometry.covariance import ros_from_planar
from slamreplay.testing.edits import rebuilt


@pytest.fixture(scope="module")
def sound():
    return healthy(seconds=20.0)


def with_scans(bundle, change=None, **columns):
    """Scans with other ranges (a function of the matrix) or other columns."""
    table = bundle.table("scans")
    n = len(table)
    if change is not None:
        matrix = table["ranges_m"].values.reshape(n, -1).copy()
        change(matrix)
        columns["ranges_m"] = Ragged(matrix.ravel(), table["ranges_m"].offsets)
    filled = {k: v if isinstance(v, Ragged) else np.full(n, v) for k, v in columns.items()}
    return rebuilt(bundle, {"scans": table.replace(**filled)})


def test_a_sound_laser_is_left_alone(sound):
    assert findings(sound, "lasers", "numbers") == []


def freeze(m):
    m[50:60] = m[49]


def level(m):
    m[50:60] = 3.25


def blank(m):
    m[50:60] = np.nan


def zeros(m):
    m[50:60] = 0.0


@pytest.mark.parametrize(
    ("change", "columns", "severity", "words"),
    [
        (freeze, {}, "warning", "10 of 200 scans repeat the one before although the robot moved"),
        (level, {}, "warning", "10 of 200 scans tell one range in all beams"),
        (blank, {}, "warning", "10 of 200 scans have no beam that says anything"),
        (zeros, {}, "warning", "10 of 200 scans have no beam that says anything"),
        (None, {"time_increment_s": 1e-3}, "warning", "makes a scan last 0.180 s, but they come"),
        (None, {"time_increment_s": -1e-4}, "warning", "time_increment runs backwards"),
        (None, {"scan_time_s": 0.05}, "info", "scan_time says 0.050 s, but they come every 0.100"),
        (None, {"range_max_m": 0.0}, "warning", "range_max is not beyond range_min in 200 of 200"),
    ],
)
def test_numbers_of_a_laser_that_do_not_fit(sound, change, columns, severity, words):
    (found,) = findings(with_scans(sound, change, **columns), "lasers")

    assert found[:2] == ("SR-DAT-005", severity)
    assert words in found[2]


@pytest.mark.parametrize(
    "columns",
    [{"time_increment_s": 5e-4}, {"scan_time_s": 0.0}, {"scan_time_s": 0.11}],
)
def test_numbers_of_a_laser_that_fit(sound, columns):
    assert findings(with_scans(sound, **columns), "lasers") == []


def test_free_space_is_something_to_say(sound):
    def open_space(m):
        m[50:60] = np.inf

    assert findings(with_scans(sound, open_space), "lasers") == []


def test_a_robot_that_stands_before_a_noiseless_laser_sees_the_same(sound):
    table = with_scans(sound, freeze).table("scans")

    assert laser_numbers(table, None).frozen == 0


def test_scans_of_different_length(sound):
    table = sound.table("scans")
    rows = [row if k % 3 else row[:-1] for k, row in enumerate(table["ranges_m"])]
    rows[31] = rows[32] = rows[34]  # three of one length in a row, two of them the same again
    ragged = Ragged.of(rows, np.float32)
    found = laser_numbers(table.replace(ranges_m=ragged), _odometry(sound))

    assert found.scans == 200
    assert found.frozen == 1
    assert found.blank == 0


def test_scans_without_beams_are_blank(sound):
    table = sound.table("scans")
    empty = Ragged(np.zeros(0, np.float32), np.zeros(len(table) + 1, np.int64))

    assert laser_numbers(table.replace(ranges_m=empty), None).blank == 200


def _odometry(bundle):
    from slamreplay.bundle.odometry import odometry_track

    return odometry_track(bundle.view())


def test_a_last_beam_that_is_elsewhere_is_told(sound):
    loss = Loss(kind="repaired", what="/scan", count=200, reason=ODD_ANGLES)
    (found,) = findings(with_manifest(sound, losses=[loss]), "lasers")

    assert found[1] == "info"
    assert "angle_max does not fit the increments and beams of 200 scans" in found[2]


def test_findings_count_placeholders_and_say_what_became_of_them(sound):
    table, poses = sound.table("odometry"), sound.table("poses")
    n, m = len(table), len(poses)
    wild = np.ones((n, 3))
    wild[:9, 0] = np.nan
    constant = ros_from_planar(np.tile(np.diag([0.25, 0.25, 0.07]), (m, 1, 1)))
    odd = rebuilt(sound, {
        "odometry": table.replace(pose_covariance=np.zeros((n, 36)), linear_velocity_xyz=wild),
        "poses": poses.replace(covariance=constant),
    })  # fmt: skip

    def found(check):
        return CHECKS.load(check)(CheckContext(None, (), odd.view()))

    first, second = found("numbers")
    assert (first.id, first.severity) == ("SR-DAT-003", "info")
    assert f"pose_covariance all zero in {n} of {n}" in first.message
    assert first.message.endswith("read as not given")
    assert (second.id, second.severity) == ("SR-DAT-004", "warning")
    assert f"linear_velocity_xyz in 9 of {n}" in second.message
    (belief,) = found("covariance")
    assert (belief.id, belief.severity, belief.n) == ("SR-CON-002", "warning", m)
    assert f"{m} of {m}" in belief.message
    assert "placeholder" in belief.message
