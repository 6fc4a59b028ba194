"""States of batteries, parameters and nodes become health rows; of states the changes are kept."""

import numpy as np
import pytest
from payloads import read_back

from slamreplay.geometry.times import NO_STAMP
from slamreplay.ingest.pipeline import ingest
from slamreplay.ingest.repeats import REPEATS
from slamreplay.verdict.motion import protections

SECOND = 10**9
EPOCH = 1_700_000_000 * SECOND
BATTERY, CONFIG = "sensor_msgs/msg/BatteryState", "dynamic_reconfigure/msg/Config"
EVENT, TRANSITION = "rcl_interfaces/msg/ParameterEvent", "lifecycle_msgs/msg/TransitionEvent"
STATUS, ODOM = "diagnostic_msgs/msg/DiagnosticStatus", "nav_msgs/msg/Odometry"


def said(rows):
    columns = rows.columns
    return list(zip(columns["name"], columns["message"], strict=True))


def test_battery_states_and_what_the_current_says_where_they_are_unknown(logs):
    nan = float("nan")
    states = [(2, nan, ""), (1, nan, ""), (4, nan, "slot 2"), (9, nan, ""), (0, 2.0, ""),
              (0, 0.2, ""), (0, -3.0, ""), (3, 9.0, "")]  # fmt: skip

    def make(ros):
        return [
            logs.make(BATTERY, ros, header__stamp__sec=k + 1, power_supply_status=status,
                      current=current, location=place)
            for k, (status, current, place) in enumerate(states)
        ]  # fmt: skip

    rows, _ = read_back(logs, BATTERY, make)

    assert said(rows) == [
        ("battery", "discharging"), ("battery", "charging"), ("slot 2", "full"),
        ("battery", "unknown"), ("battery", "charging"), ("battery", "not charging"),
    ]  # fmt: skip
    assert set(rows.columns["level"]) == {20}
    assert (rows.t_sensor_ns // SECOND).tolist() == list(range(1, 7))


def test_of_states_the_changes_are_kept_and_the_others_counted(logs):
    statuses = [2, 2, 1, 1, 1, 2]

    def make(ros):
        messages = []
        for status in statuses:
            for place in ("", "slot 2"):
                values = {"power_supply_status": status if place else 2, "current": float("nan")}
                messages.append(logs.make(BATTERY, ros, location=place, **values))
        return messages

    kept, told = read_back(logs, BATTERY, make)

    assert said(kept) == [
        ("battery", "discharging"), ("slot 2", "discharging"), ("slot 2", "charging"),
        ("slot 2", "discharging"),
    ]  # fmt: skip
    assert told == {("skipped", REPEATS): 8}


def parameter(logs, name, **value):
    fields = {f"value__{k}": v for k, v in value.items()}
    return logs.make("rcl_interfaces/msg/Parameter", name=name, **fields)


def test_parameters_are_told_with_node_name_and_value(logs):
    def make(ros):
        new = [parameter(logs, "use_sim_time", type=1, bool_value=True),
               parameter(logs, "odd", type=0)]  # fmt: skip
        changed = [
            parameter(logs, "max_beams", type=2, integer_value=60),
            parameter(logs, "z_hit", type=3, double_value=0.1),
            parameter(logs, "frame", type=4, string_value="odom"),
            parameter(logs, "plugins", type=9, string_array_value=["a", "b"]),
            parameter(logs, "footprint", type=8, double_array_value=np.arange(10.0)),
            parameter(logs, "key", type=5, byte_array_value=np.uint8([1, 2])),
        ]
        deleted = [parameter(logs, "old", type=2)]
        event = logs.make(EVENT, stamp__sec=3, node="/amcl", new_parameters=new,
                          changed_parameters=changed, deleted_parameters=deleted)  # fmt: skip
        return [event, logs.make(EVENT, node="/nobody"), event]

    rows, _ = read_back(logs, EVENT, make, ros=(2,))

    assert said(rows)[:9] == [
        ("/amcl: use_sim_time", "declared as true"),
        ("/amcl: odd", "declared as nothing"),
        ("/amcl: max_beams", "set to 60"),
        ("/amcl: z_hit", "set to 0.1"),
        ("/amcl: frame", "set to odom"),
        ("/amcl: plugins", "set to [a, b]"),
        ("/amcl: footprint", "set to [0, 1, 2, 3, 4, 5, 6, 7, ...]"),
        ("/amcl: key", "set to [1, 2]"),
        ("/amcl: old", "deleted"),
    ]
    assert said(rows)[9:] == said(rows)[:9]
    assert set(rows.t_sensor_ns) == {3 * SECOND}


def test_parameters_of_ros_1_are_named_by_their_topic(logs):
    def make(ros):
        config = "dynamic_reconfigure/msg/"
        return [
            logs.make(
                CONFIG, 1,
                bools=[logs.make(f"{config}BoolParameter", 1, name="on", value=True)],
                ints=[logs.make(f"{config}IntParameter", 1, name="skip", value=3)],
                strs=[logs.make(f"{config}StrParameter", 1, name="port", value="/dev/x")],
                doubles=[logs.make(f"{config}DoubleParameter", 1, name="max", value=value)],
            )
            for value in (0.5, 0.7)
        ]  # fmt: skip

    kept, told = read_back(logs, CONFIG, make, topic="/laser/parameter_updates", ros=(1,))

    assert said(kept) == [
        ("/laser: on", "set to true"), ("/laser: skip", "set to 3"),
        ("/laser: port", "set to /dev/x"), ("/laser: max", "set to 0.5"),
        ("/laser: max", "set to 0.7"),
    ]  # fmt: skip
    assert told == {("skipped", REPEATS): 3}


def test_nodes_are_told_with_their_states(logs):
    def make(ros):
        labels = {"start_state__label": "inactive", "goal_state__label": "active"}
        return [logs.make(TRANSITION, **labels)]

    rows, _ = read_back(logs, TRANSITION, make, topic="/r1/amcl/transition_event", ros=(2,))

    assert said(rows) == [("/r1/amcl", "inactive -> active")]
    assert rows.t_sensor_ns.tolist() == [NO_STAMP]


def test_a_single_diagnostic_status(logs):
    def make(ros):
        return [logs.make(STATUS, ros, level=2, name="laser", message="dirty")]

    rows, _ = read_back(logs, STATUS, make)

    assert said(rows) == [("laser", "dirty")]
    assert rows.columns["level"].tolist() == [2]


def test_a_clock_tells_its_time_and_is_placed_by_when_it_was_recorded(logs, tmp_path):
    kind = "rosgraph_msgs/msg/Clock"

    def make(ros):
        return [logs.make(kind, ros), logs.make(kind, ros, clock__sec=2**31 - 1, clock__nanosec=5)]

    rows, _ = read_back(logs, kind, make)

    assert rows.columns["clock_ns"].tolist() == [0, (2**31 - 1) * SECOND + 5]
    odometry = logs.make(ODOM, header__frame_id="odom", pose__pose__orientation__w=1.0)
    messages = [("/odom", ODOM, odometry, EPOCH), ("/clock", kind, make(2)[1], EPOCH + SECOND)]
    bundle = ingest([logs.write("log.mcap", messages)], tmp_path / "b")
    table = bundle.view().role("clock")
    assert table["t_log_ns"].tolist() == table.t_ns.tolist() == [EPOCH + SECOND]
    assert table["clock_ns"].dtype == np.int64
    assert not [x for x in bundle.manifest.losses if x.what == "/clock"]


@pytest.mark.parametrize("name", ["log.mcap", "log.db3"])
def test_charging_edges_of_a_log_and_no_false_protective_stop(logs, tmp_path, name):
    messages = []
    for k in range(6):
        t = EPOCH + k * SECOND
        stamp = {"header__stamp__sec": t // SECOND}
        odometry = logs.make(ODOM, header__frame_id="odom", child_frame_id="base_link",
                             pose__pose__orientation__w=1.0, **stamp)  # fmt: skip
        battery = logs.make(BATTERY, power_supply_status=1 if k == 4 else 2, **stamp)
        switch = parameter(logs, "bumper", type=1, bool_value=True)
        values = {"stamp__sec": t // SECOND, "new_parameters": [switch]}
        bumper = logs.make(EVENT, node="/base", **values)
        messages += [("/odom", ODOM, odometry, t), ("/battery_state", BATTERY, battery, t),
                     ("/parameter_events", EVENT, bumper, t)]  # fmt: skip

    bundle = ingest([logs.write(name, messages)], tmp_path / "b")

    health = bundle.table("health")
    battery = health.take(health["topic"] == "/battery_state")
    assert battery["message"].tolist() == ["discharging", "charging", "discharging"]
    assert ((battery.t_ns - EPOCH) // SECOND).tolist() == [0, 4, 5]
    assert protections(bundle.view(), EPOCH, EPOCH + 6 * SECOND) is None
