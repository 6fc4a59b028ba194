"""What can go wrong that the user can mend: one line that says what, where, and a hint."""

from __future__ import annotations


class SlamreplayError(Exception):
    """A fault in the input or the usage; the command line prints it as one line and exits with 2.

    Args:
        what: what is wrong, as a short sentence without a full stop.
        where: the file, topic or key it was found in.
        hint: what the user can do about it.
    """

    def __init__(self, what: str, *, where: object = None, hint: str | None = None) -> None:
        super().__init__(what)
        self.what = what
        self.where = where
        self.hint = hint

    def __str__(self) -> str:
        line = self.what if self.where is None else f"{self.where}: {self.what}"
        line = line if self.hint is None else f"{line} (hint: {self.hint})"
        return " ".join(line.split())

    def _render_traceback_(self) -> list[str]:
        """What IPython shows: where in our code it was found out is of no use to a reader."""
        return [f"{type(self).__name__}: {self}"]


class LogError(SlamreplayError):
    """A log that cannot be read, or that holds nothing to work with."""


class BundleError(SlamreplayError):
    """A bundle that is not whole: wrong format, wrong hash, a table that breaks its schema."""


class MapError(SlamreplayError):
    """A map file that cannot be read or makes no sense."""


class TransformError(SlamreplayError):
    """A frame that is not in the tree, or a tree that is not one."""


class UsageError(SlamreplayError):
    """A request that cannot be met: unknown name, level that is no number, foreign folder."""


class OutputError(SlamreplayError):
    """A place that cannot be written."""


class NotApplicableError(SlamreplayError):
    """A trial that this log or this estimator does not allow: something it needs is not there."""
