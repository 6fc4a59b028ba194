"""The synthetic bundle says what it claims to say."""

import numpy as np

from slamreplay.bundle.belief import recorded_belief
from slamreplay.bundle.odometry import odometry_track
from slamreplay.bundle.scans import scan_set
from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.store import write_bundle
from slamreplay.bundle.view import Bundle
from slamreplay.geometry import se2
from slamreplay.maps.likelihood_field import distance_field
from slamreplay.testing.synthetic import START_NS, synthetic_bundle, true_path


def test_scans_lie_on_the_map_and_the_belief_on_the_path():
    view = synthetic_bundle(seconds=12.0).view()
    scans, distance = scan_set(view), distance_field(view.grid, 1.0)
    true = true_path((scans.t_ns - START_NS) / 1e9)

    belief = recorded_belief(view, scans.t_ns)
    row, col = view.grid.cell_of(se2.transform_points(true[60], scans.points(60))).T

    assert len(scans) == 120
    assert np.abs(se2.between(true, belief.xyyaw)).max() < 0.06
    assert np.quantile(distance[row, col], 0.95) < 0.08
    assert len(odometry_track(view)) == 241


def test_belief_can_be_wrong_from_a_moment_on():
    view = synthetic_bundle(belief_offset_xyyaw=(2.0, 0.0, 0.0), offset_from_s=10.0).view()
    scans = scan_set(view)

    belief = recorded_belief(view, scans.t_ns)

    off = se2.between(true_path((scans.t_ns - START_NS) / 1e9), belief.xyyaw)
    assert np.abs(off[:95]).max() < 0.1
    np.testing.assert_allclose(off[110:, 0], 2.0, atol=0.1)


def test_parts_can_be_left_out_and_the_rest_is_written_to_disk(tmp_path):
    bundle = synthetic_bundle(with_map=False, with_belief=False, with_initial_pose=False)

    assert bundle.grid() is None
    assert recorded_belief(bundle.view(), np.array([START_NS])) is None
    tables = {name: bundle.table(name) for name in TABLES}
    write_bundle(tmp_path / "b", bundle.manifest, tables, {})
    assert len(Bundle.open(tmp_path / "b").table("scans")) == 200
