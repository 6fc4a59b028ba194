"""The message layouts that ship parse, refer to nothing unknown, and read back what was written."""

import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from slamreplay.messages.definitions import DEFINITIONS, LATER_DEFINITIONS


def store_with(definitions, name):
    store = get_typestore(name)
    for msgtype, text in definitions.items():
        if msgtype not in store.fielddefs:
            store.register(get_types_from_msg(text, msgtype))
    return store


@pytest.mark.parametrize("name", [Stores.ROS1_NOETIC, Stores.ROS2_HUMBLE, Stores.ROS2_JAZZY])
@pytest.mark.parametrize("definitions", [DEFINITIONS, {**DEFINITIONS, **LATER_DEFINITIONS}])
def test_every_layout_is_complete(name, definitions):
    store = store_with(definitions, name)

    for msgtype in definitions:
        text, digest = store.generate_msgdef(msgtype)
        assert text or not definitions[msgtype]
        assert digest


def test_status_change_of_humble_has_no_uid():
    humble = store_with(DEFINITIONS, Stores.ROS2_HUMBLE)
    jazzy = store_with({**DEFINITIONS, **LATER_DEFINITIONS}, Stores.ROS2_JAZZY)
    fields = "nav2_msgs/msg/BehaviorTreeStatusChange"

    assert "uid" not in [f[0] for f in humble.fielddefs[fields][1]]
    assert "uid" in [f[0] for f in jazzy.fielddefs[fields][1]]
