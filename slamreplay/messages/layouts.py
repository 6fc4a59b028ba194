"""All layouts a type may have on the wire, as complete definitions to try one after the other.

Several releases give one name to different messages, and a log without definitions does not say
whose it is. The layout that reads a message to its very end is the one it was written with.
"""

from __future__ import annotations

import re
from itertools import product

from slamreplay.messages.definitions import DEFINITIONS, LATER_DEFINITIONS
from slamreplay.messages.interfaces import SEPARATOR, base_interface, message_definition
from slamreplay.messages.recoveries import INTERFACES

_KIND = re.compile(r"^(?:MSG: )?(\w+/\w+|\w+/\w+/\w+)(?:\[[^\]]*\])?[ \t]+\w", re.MULTILINE)


def layouts(type_name: str) -> list[str]:
    """Complete definitions of a message type, newest first; [] for a type that is not shipped.

    Each has the form of MCAP and ROS 1 bags: the fields, then the types they need that neither
    ROS's own type store has, under a line of `=` and `MSG: name`.
    """
    texts = _texts(type_name)
    needed = sorted(_needed(texts) - {type_name})
    found = [
        "".join([text, *(f"{SEPARATOR}MSG: {n}\n{t}" for n, t in zip(needed, chosen, strict=True))])
        for text in texts
        for chosen in product(*(_texts(name) for name in needed))
    ]
    return list(dict.fromkeys(found))


def _texts(type_name: str) -> list[str]:
    """A type's own fields in each layout, newest first."""
    releases = INTERFACES.get(base_interface(type_name))
    if releases is not None:
        return list(dict.fromkeys(message_definition(type_name, t) for t in releases.values()))
    found = (d.get(type_name) for d in (LATER_DEFINITIONS, DEFINITIONS))
    return [text for text in found if text is not None]


def _needed(texts: list[str]) -> set[str]:
    """Shipped types that fields of these texts have, and those that fields of theirs have."""
    names: set[str] = set()
    for text in texts:
        for kind in _KIND.findall(text):
            name = kind if kind.count("/") == 2 else kind.replace("/", "/msg/")
            if name in DEFINITIONS and name not in names:
                names |= {name, *_needed(_texts(name))}
    return names
