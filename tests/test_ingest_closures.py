"""Closures of SLAM systems, as far as their messages tell, each when it was first told."""

import numpy as np
import pytest
from payloads import Container, read_back

from slamreplay.ingest.pipeline import ingest
from slamreplay.ingest.reading import read_rows
from slamreplay.ingest.repeats import REPEATS, without_repeats

SECOND = 10**9
EPOCH = 1_700_000_000 * SECOND
INFO, ARRAY = "rtabmap_msgs/msg/Info", "visualization_msgs/msg/MarkerArray"
ODOM = "nav_msgs/msg/Odometry"
SPHERE, STRIP, LINES = 2, 4, 5


def told_of(rows):
    return list(zip(*(rows.columns[n] for n in ("kind", "from_id", "to_id")), strict=True))


def test_closures_of_rtabmap_and_the_value_of_the_one_it_accepted(logs):
    keys = ["Loop/Highest_hypothesis_id/", "Loop/Highest_hypothesis_value/"]
    cases = [(10, 0, 0, 0, [4, 0.25]), (11, 4, 0, 0, [4, 0.75]), (12, 0, 7, 0, [4, 0.5]),
             (13, 5, 6, -2, [9, 0.5])]  # fmt: skip

    def make(ros):
        return [
            logs.make(INFO, ros, header__frame_id="map", header__stamp__sec=ref, ref_id=ref,
                      loop_closure_id=loop, proximity_detection_id=near, landmark_id=mark,
                      stats_keys=keys, stats_values=np.float32(stats))
            for ref, loop, near, mark, stats in cases
        ]  # fmt: skip

    rows, told = read_back(logs, INFO, make)

    assert told_of(rows) == [
        ("loop_closure", "11", "4"), ("proximity", "12", "7"), ("loop_closure", "13", "5"),
        ("proximity", "13", "6"), ("landmark", "13", "-2"),
    ]  # fmt: skip
    np.testing.assert_array_equal(rows.columns["score"], [0.75] + [np.nan] * 4)
    assert (rows.t_sensor_ns // SECOND).tolist() == [11, 12, 13, 13, 13]
    assert np.isnan(rows.columns["from_xyz"]).all()
    assert told == {}


def test_rtabmap_of_ros_1_writes_its_fields_in_camel_case(logs):
    kind = "rtabmap_ros/msg/Info"

    def make(ros):
        return [logs.make(kind, ros, refId=3, loopClosureId=1, proximityDetectionId=2)]

    rows, _ = read_back(logs, kind, make)

    assert told_of(rows) == [("loop_closure", "3", "1"), ("proximity", "3", "2")]


class Markers:
    """Markers of SLAM graphs."""

    def __init__(self, logs, ros):
        self.logs, self.ros = logs, ros

    def point(self, x, y):
        return self.logs.make("geometry_msgs/msg/Point", self.ros, x=x, y=y)

    def lines(self, space, pairs, kind=LINES, **values):
        points = [self.point(*xy) for pair in pairs for xy in pair]
        return self.marker(space, type=kind, points=points, **values)

    def marker(self, space, **values):
        header = {"header__frame_id": "map", "header__stamp__sec": 5}
        return self.logs.make("visualization_msgs/msg/Marker", self.ros, ns=space, **header,
                              **values)  # fmt: skip

    def node(self, number, x, y):
        place = {"pose__position__x": x, "pose__position__y": y}
        return self.marker("slam_toolbox", type=SPHERE, id=number, **place)

    def array(self, *markers):
        return self.logs.make(ARRAY, self.ros, markers=list(markers))


PLACES = {1: (0.0, 0.0), 2: (1.0, 0.0), 3: (2.0, 0.5), 4: (0.1, 0.1)}


@pytest.mark.parametrize("layout", ["one list", "a marker each"])
def test_links_of_slam_toolbox_are_named_by_the_nodes_at_their_ends(logs, layout):
    edges = [(1, 2), (2, 3), (3, 4), (4, 1)]

    def make(ros):
        m = Markers(logs, ros)
        nodes = [m.node(number, *xy) for number, xy in PLACES.items()]
        pairs = [(PLACES[a], PLACES[b]) for a, b in edges]
        if layout == "one list":
            lines = [m.lines("slam_toolbox_edges", pairs)]
        else:
            lines = [m.lines("slam_toolbox", [p], STRIP, id=9 + k) for k, p in enumerate(pairs)]
        clear = m.marker("", action=3)
        return [m.array(clear, *nodes[:2]), m.array(clear, *nodes, *lines)] * 2

    rows, told = read_back(logs, ARRAY, make)

    assert told_of(rows) == [("link", "4", "1")]
    assert rows.columns["from_xyz"].tolist() == [[0.1, 0.1, 0.0]]
    assert rows.frame() == "map"
    assert rows.t_log_ns.tolist() == [20]  # when it was first told
    assert told == {
        ("skipped", "links of a scan to the one before it"): 6,
        ("skipped", "graphs without their links"): 2,
        ("skipped", REPEATS): 1,
    }


def test_links_between_nodes_that_are_not_shown_are_counted(logs):
    def make(ros):
        m = Markers(logs, ros)
        pairs = [(PLACES[1], PLACES[3]), (PLACES[3], (9.0, 9.0))]
        return [
            m.array(
                m.node(1, *PLACES[1]), m.node(3, *PLACES[3]), m.lines("slam_toolbox_edges", pairs)
            )
        ]

    rows, told = read_back(logs, ARRAY, make)

    assert told_of(rows) == [("link", "1", "3")]
    assert told == {("skipped", "links whose ends no marker names"): 1}


def cartographer(logs, ros, same, other):
    m = Markers(logs, ros)
    inner = [((0.0, 0.0), (0.0, 1.0))] * 5
    spaces = {"Intra constraints": inner, "Intra residuals": inner,
              "Inter constraints, same trajectory": same,
              "Inter residuals, same trajectory": same,
              "Inter constraints, different trajectories": other}  # fmt: skip
    return m.array(*(m.lines(space, pairs) for space, pairs in spaces.items()))


def test_constraints_of_cartographer_have_places_and_no_ids(logs):
    first, second, third = [((k, 0.0), (k, 1.0)) for k in (1.0, 2.0, 3.0)]

    def make(ros):
        return [
            cartographer(logs, ros, [first], []),
            cartographer(logs, ros, [first], []),
            cartographer(logs, ros, [first, second], [third]),
        ]

    rows, told = read_back(logs, ARRAY, make)

    assert told_of(rows) == [
        ("inter_submap", "", ""), ("inter_submap", "", ""), ("inter_trajectory", "", ""),
    ]  # fmt: skip
    assert rows.columns["number"].tolist() == [0, 1, 0]
    assert rows.columns["to_xyz"].tolist() == [[1, 1, 0], [2, 1, 0], [3, 1, 0]]
    assert rows.t_log_ns.tolist() == [10, 30, 30]
    assert told == {
        ("skipped", REPEATS): 2, ("skipped", "markers of a graph that are no closure"): 9,
    }  # fmt: skip


def test_parts_that_a_topic_is_decoded_in_make_no_difference(logs):
    def make(ros):
        pairs = [((k, 0.0), (k, 1.0)) for k in (1.0, 2.0)]
        return [cartographer(logs, ros, pairs[: 1 + k // 2], []) for k in range(4)]

    whole, _ = read_back(logs, ARRAY, make)
    store = logs.stores[2]
    payloads = [bytes(store.serialize_cdr(m, ARRAY)) for m in make(2)]
    container = Container("/topic", ARRAY, payloads, "cdr", at_once=1)
    (parts,), _ = read_rows([container], lambda _: None, None)
    joined, _ = without_repeats(parts)

    assert len(parts) > len(whole)
    assert joined.t_log_ns.tolist() == whole.t_log_ns.tolist() == [10, 30]


def test_markers_that_are_called_no_graph_are_not_read(logs, tmp_path):
    odometry = logs.make(ODOM, header__frame_id="odom", header__stamp__sec=EPOCH // SECOND,
                         pose__pose__orientation__w=1.0)  # fmt: skip
    array = cartographer(logs, 2, [((0.0, 0.0), (1.0, 1.0))], [])
    topics = ("/constraint_list", "/people", "/trajectory_node_list")
    messages = [("/odom", ODOM, odometry, EPOCH)]
    messages += [(topic, ARRAY, array, EPOCH) for topic in topics]

    bundle = ingest([logs.write("log.mcap", messages)], tmp_path / "b")

    (role,) = [r for r in bundle.manifest.roles if r.role == "closure"]
    assert role.topic == "/constraint_list"
    assert len(bundle.view().role("closure")) == 1
    skipped = {x.what for x in bundle.manifest.losses if x.reason == "by its name no SLAM graph"}
    assert skipped == {f"{t} ({ARRAY})" for t in topics[1:]}
