"""rosbags' type stores with the types that they lack and we ship: the tests' own serialiser."""

from functools import cache

from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from slamreplay.messages.definitions import DEFINITIONS, LATER_DEFINITIONS
from slamreplay.messages.interfaces import as_message
from slamreplay.messages.layouts import layouts
from slamreplay.messages.recoveries import INTERFACES


@cache
def type_store(ros=2, *, later=False):
    """The store of ROS 1 or 2; with the newer layouts of our types where asked."""
    store = get_typestore(Stores.ROS1_NOETIC if ros == 1 else Stores.ROS2_HUMBLE)
    for name, text in (DEFINITIONS | LATER_DEFINITIONS if later else DEFINITIONS).items():
        if name not in store.fielddefs:
            store.register(get_types_from_msg(text, name))
    for base in INTERFACES if ros == 2 else ():
        parts = ["Event"] if "/srv/" in base else ["FeedbackMessage", "SendGoal_Event"]
        for name in (f"{base}_{part}" for part in parts):
            register_layout(store, name, layouts(name)[0 if later else -1])
    return store


def register_layout(store, name, text):
    """Add a type in one of its layouts, with the types it needs, to a type store."""
    found = get_types_from_msg(text, as_message(name))
    store.register({k: v for k, v in found.items() if k not in store.fielddefs})
