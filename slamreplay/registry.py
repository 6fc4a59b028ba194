"""Named things that are loaded when asked for: estimators, perturbations, checks, labs."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from difflib import get_close_matches
from importlib import import_module
from importlib.metadata import entry_points
from typing import Any

from slamreplay.errors import UsageError


def nearest(name: str, names: Iterable[str]) -> str:
    """A hint for a name that there is not: the nearest one, else all there are."""
    there = list(names)
    near = get_close_matches(name, there, n=1)
    return f"did you mean '{near[0]}'?" if near else f"there are: {', '.join(there)}"


class Registry:
    """Names of one kind of thing, each with the place it is loaded from.

    Args:
        kind: what one entry is, in the singular ("estimator"); the entry point group is
            `slamreplay.<kind>s`, by which other packages add theirs.
        builtin: name to "module:attribute". Nothing is imported before `load`.
    """

    def __init__(self, kind: str, builtin: Mapping[str, str]) -> None:
        self.kind = kind
        self._builtin = dict(builtin)
        self._targets: dict[str, str] | None = None

    def targets(self) -> dict[str, str]:
        """Every name with the "module:attribute" it is loaded from, sorted; ours win."""
        if self._targets is None:  # entry points are read from every installed package's files
            found = {e.name: e.value for e in entry_points(group=f"slamreplay.{self.kind}s")}
            self._targets = dict(sorted({**found, **self._builtin}.items()))
        return self._targets

    def __iter__(self) -> Iterator[str]:
        return iter(self.targets())

    def __contains__(self, name: object) -> bool:
        return name in self.targets()

    def is_ours(self, name: str) -> bool:
        """Whether it comes with slamreplay, and not from somebody else's package."""
        return name in self._builtin

    def target(self, name: str) -> str:
        """Where `name` is loaded from, as "module:attribute"; nothing is imported.

        Raises:
            UsageError: nothing has that name; the hint holds the nearest one.
        """
        targets = self.targets()
        if name not in targets:
            raise UsageError(f"there is no {self.kind} '{name}'", hint=nearest(name, targets))
        return targets[name]

    def load(self, name: str) -> Any:
        """The object registered under `name`.

        Raises:
            UsageError: nothing has that name; the hint holds the nearest one.
        """
        module, _, attribute = self.target(name).partition(":")
        return getattr(import_module(module), attribute)
