"""rosbags' type stores with the types that they lack and we ship: the tests' own serialiser."""

from functools import cache

from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from slamreplay.messages.definitions import DEFINITIONS, LATER_DEFINITIONS


@cache
def type_store(ros=2, *, later=False):
    """The store of ROS 1 or 2; with the newer layouts of our types where asked."""
    store = get_typestore(Stores.ROS1_NOETIC if ros == 1 else Stores.ROS2_HUMBLE)
    for name, text in (DEFINITIONS | LATER_DEFINITIONS if later else DEFINITIONS).items():
        if name not in store.fielddefs:
            store.register(get_types_from_msg(text, name))
    return store
