"""Names of topics, frames and nodes as others, the same one every time."""

from __future__ import annotations

import re

from slamreplay.export.standard_words import STANDARD_WORDS
from slamreplay.ingest.names import tokens
from slamreplay.ingest.sightings import is_tag_frame

_PLAIN = re.compile(r"[A-Za-z0-9_.:-]+")
_WORD = re.compile(r"[^\s/,;=()\[\]{}\"']+")


class Pseudonyms:
    """Gives out names; each distinct part of a name keeps the one it was given first."""

    def __init__(self) -> None:
        self._given: dict[str, str] = {}
        self._numbers: dict[str, dict[str, int]] = {}

    def number(self, kind: str, text: str) -> int:
        """The number of a text among all of its kind that were asked for, from 1."""
        known = self._numbers.setdefault(kind, {})
        return known.setdefault(text, len(known) + 1)

    def topic(self, name: str) -> str:
        """A namespace, then the topic's own: /acme_7/base_scan as /robot_1/topic_1_scan."""
        *spaces, last = name.split("/")
        return "/".join([*(self.part(s, "robot") for s in spaces), self.part(last, "topic")])

    def frame(self, name: str) -> str:
        """As topics: acme_7/left_eye as robot_1/frame_1_left."""
        *spaces, last = name.split("/")
        return "/".join([*(self.part(s, "robot") for s in spaces), self.part(last, "frame")])

    def part(self, part: str, kind: str) -> str:
        """A part without slashes: as it is if all its words are standard, else a pseudonym."""
        if part in self._given:
            return self._given[part]
        words = tokens(part)
        known = [word for word in words if word in STANDARD_WORDS]
        digits = [word for word in words if word.isdigit()]
        # A digit tells front laser 2 from 1, but also robot 7 from 6; long numbers tell more.
        numbered = is_tag_frame(part) or all(len(d) == 1 and kind != "robot" for d in digits)
        if _PLAIN.fullmatch(part or "_") and len(known) + len(digits) == len(words) and numbered:
            new = part
        else:
            meant = [word for word in known if word != kind]
            new = "_".join([f"{kind}_{self.number(kind, part)}", *meant])
        self._given[part] = new
        return new

    def phrase(self, text: str, kind: str) -> str:
        """A text of several names: each word by itself."""
        return _WORD.sub(lambda match: self.part(match[0], kind), text)

    def text(self, text: str) -> str:
        """A text of ours, every word that was given another name replaced."""
        return _WORD.sub(lambda match: self._given.get(match[0], match[0]), text)
