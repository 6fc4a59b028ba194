"""What was worked out of evidence, found again by the very objects it was made of."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from typing import Any, TypeVar

T = TypeVar("T")

#: Results of one kind that are kept: two lasers, or two ways to lay out the same scans.
MOST = 2


class Shared:
    """Results by their kind, by what else they depend on, and by the objects they were made of.

    Objects are told apart by identity, not by value: what was exchanged is never taken for what it
    replaces. They are kept as long as their result is, so that no other takes their place.
    """

    def __init__(self) -> None:
        self._kinds: dict[str, dict[Hashable, tuple[Any, Sequence[object]]]] = {}

    def of(
        self, kind: str, detail: Hashable, objects: Sequence[object], make: Callable[[], T]
    ) -> T:
        """What `make` gives, called where nothing made of these objects is at hand.

        Args:
            kind: of the result; of each the latest `MOST` are kept.
            detail: what the result depends on beside the objects.
            objects: all that `make` reads; they never change.
            make: what it gives must not be changed by anybody.
        """
        found = self._kinds.setdefault(kind, {})
        key = (detail, *(id(each) for each in objects))
        if key in found:
            found[key] = found.pop(key)  # the latest stand last
            kept: T = found[key][0]
            return kept
        made = make()
        found[key] = made, tuple(objects)
        while len(found) > MOST:
            del found[next(iter(found))]
        return made
