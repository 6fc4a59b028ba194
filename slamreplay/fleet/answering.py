"""All answers of a fleet from its folder of tables."""

from __future__ import annotations

from pathlib import Path

from slamreplay.fleet.answers import Answers
from slamreplay.fleet.areas import areas, looks_at_changes
from slamreplay.fleet.causes import causes
from slamreplay.fleet.counted import Counted, counted
from slamreplay.fleet.failures import failures
from slamreplay.fleet.gathered import Gathered, gathered
from slamreplay.fleet.in_use import InUse
from slamreplay.fleet.map_places import map_places
from slamreplay.fleet.picks import picks
from slamreplay.fleet.snapshot import Snapshot, of_now
from slamreplay.fleet.spots import spots
from slamreplay.fleet.steps import steps
from slamreplay.fleet.troubles import troubles_s
from slamreplay.fleet.verdicts import Alike, verdicts


def answers(folder: Path) -> Answers:
    """What the tables of a batch's folder tell; the same rows give the same answers.

    Args:
        folder: of the batch; one without tables has answers about nothing.
    """
    lines: list[str] = []

    def look(now: Snapshot) -> Answers:
        logs = counted(now)
        return _answers(now, logs, lines)

    return of_now(folder, look, lines.append)


def _answers(now: Snapshot, logs: Counted, lines: list[str]) -> Answers:
    alike = Alike(logs)
    total, by = verdicts(logs, alike)
    found = gathered(now, logs)
    seen = looks_at_changes(now, logs, found)
    in_use = InUse(logs)
    worth = alike.worth("lost", logs.judged.nonzero()[0])
    return Answers(
        total=total,
        by=by,
        causes=causes(logs),
        spots=spots(logs, found),
        areas=areas(now, logs, found, seen, in_use),
        picks=picks(logs, found),
        steps=steps(logs, alike),
        maps=map_places(logs, found, in_use),
        copies=logs.copies,
        failures=failures(logs),
        troubles_s=troubles_s(now, logs),
        logs=dict(
            zip(
                logs.texts["key"].tolist(),
                zip(logs.texts["log"].tolist(), logs.texts["report"].tolist(), strict=True),
                strict=True,
            )
        ),
        alike=float(logs.judged.sum()) / worth if worth else 1.0,
        remarks=tuple(dict.fromkeys([*lines, *_remarks(logs, found)])),
    )


def _remarks(logs: Counted, found: Gathered) -> list[str]:
    said = []
    for column in ("robot", "site", "software"):
        missing = sum(name is None for name in logs.texts[column].tolist())
        if missing:
            said.append(f"{missing} of {len(logs)} logs do not tell their {column}")
    timeless = int((~logs.failed & ~logs.ordered).sum())
    if timeless:
        said.append(
            f"{timeless} logs have clocks that tell no day: left out of what asks for an order"
        )
    if logs.copies:
        names = sum(len(copy.logs) for copy in logs.copies)
        said.append(f"{len(logs.copies)} logs came under {names} names, and count once each")
    if found.left_out:
        said.append(f"{found.left_out} places are of more maps than can be told apart; left out")
    return said
