"""Packages that can be called: `slamreplay.report(b)` beside `slamreplay.report.html`.

In a notebook five stages are wanted as functions by the names that their packages have. A package
of the name cannot give way to a function: who imports it by its dotted path needs the package, and
the import system binds it over whatever stood there. So the package itself answers the call, with
the function of its name in `slamreplay.notebook`, which is imported when it is first asked for.
Each package says so itself, in a line that can be found; a hook in the root package that changes
what it is told of its children could not.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import inspect


class Stage(ModuleType):
    """A package that passes calls on; its documentation and signature are the function's."""

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        """As the function of its name in `slamreplay.notebook`, whose result it gives."""
        return _function(self)(*args, **kwargs)

    @property
    def __signature__(self) -> inspect.Signature:
        """For help and completion."""
        import inspect  # it is large, and imported with the package it would be everybody's

        return inspect.signature(_function(self))

    @property
    def __doc__(self) -> str | None:  # type: ignore[override]
        """The function's: whoever asks for help wants to call it."""
        return _function(self).__doc__


def callable_stage(name: str) -> None:
    """Let the package `name`, `slamreplay.STAGE`, be called as STAGE of `slamreplay.notebook`."""
    sys.modules[name].__class__ = Stage


def _function(stage: ModuleType) -> Callable[..., Any]:
    # Asked for when somebody calls, not imported: the layers below know nothing of notebooks.
    root, _, name = stage.__name__.rpartition(".")
    found: Callable[..., Any] = getattr(import_module(f"{root}.notebook"), name)
    return found
