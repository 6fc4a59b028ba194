"""What of a container could not be read: bytes, messages, and the last good time before it."""

from __future__ import annotations

from slamreplay.bundle.manifest import Loss


class Damage:
    """Losses of one file while it is read; those of one kind are told as one.

    Args:
        name: of the file.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self._kept: list[Loss] = []
        self._found: dict[tuple[str, str], Loss] = {}
        self.last_good_ns: int | None = None

    def good(self, t_log_ns: int) -> None:
        """A message was read."""
        if self.last_good_ns is None or t_log_ns > self.last_good_ns:
            self.last_good_ns = t_log_ns

    def lose(
        self,
        unit: str,
        reason: str,
        *,
        at: int | None = None,
        count: int = 1,
        size: int | None = None,
    ) -> None:
        """Something is lost.

        Args:
            unit: what is counted: "chunks", "bytes", "messages".
            reason: why, without numbers that differ from one to the next.
            at: byte of the file where it begins.
            count: how many units.
            size: bytes of the file that are lost with it.
        """
        key = (unit, reason)
        before = self._found.get(key)
        if before is None:
            place = "" if at is None else f" (first at byte {at})"
            self._found[key] = Loss(
                kind="lost", what=f"{self._name}: {unit}", count=count, reason=reason + place,
                bytes=size, last_good_ns=self.last_good_ns,
            )  # fmt: skip
            return
        self._found[key] = before.model_copy(
            update={
                "count": before.count + count,
                "bytes": (before.bytes or 0) + (size or 0) or None,
            }
        )

    def count_messages(self, messages: int) -> None:
        """So many messages went with what is lost, whatever it was."""
        for key, loss in self._found.items():
            if loss.kind == "lost":
                self._found[key] = loss.model_copy(update={"messages": messages})
                return

    def mend(self, unit: str, reason: str, count: int = 1) -> None:
        """Something was read in another way than the container says."""
        key = (unit, reason)
        count += self._found[key].count if key in self._found else 0
        what = f"{self._name}: {unit}"
        self._found[key] = Loss(kind="repaired", what=what, count=count, reason=reason)

    def keep(self) -> None:
        """What was found so far is of the file itself, however often it is read."""
        self._kept = list(self._found.values())
        self.clear()

    def losses(self) -> list[Loss]:
        """All of them, in the order they were found."""
        last = {"last_good_ns": self.last_good_ns}
        return [*(loss.model_copy(update=last) for loss in self._kept), *self._found.values()]

    def clear(self) -> None:
        """Forget what reading found: the file is read again."""
        self._found.clear()
        self.last_good_ns = None
