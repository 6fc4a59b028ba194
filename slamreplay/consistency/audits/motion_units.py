"""SR-ODO-003: odometry, gyroscope and commands tell one motion in other units or hands."""

from __future__ import annotations

import numpy as np

from slamreplay.audit.motion_units import Ratio, motion_ratios
from slamreplay.bundle.findings import Finding
from slamreplay.consistency.context import CheckContext

#: What a ratio of turns, or of ways, means that is no calibration; and how near it must be.
_TURNS = {
    -1.0: "one of them has left and right exchanged",
    180.0 / np.pi: "one of them is in degrees",
    np.pi / 180.0: "one of them is in degrees",
    -180.0 / np.pi: "one of them is in degrees, and left and right are exchanged",
    -np.pi / 180.0: "one of them is in degrees, and left and right are exchanged",
}
_WAYS = {1000.0: "one of them is in millimetres", 0.001: "one of them is in millimetres"}
_NEAR, _SAME = 0.25, 0.3


def check(context: CheckContext) -> tuple[Finding, ...]:
    """One finding for turns and one for the way, with who stands against whom."""
    ratios = motion_ratios(context.view)
    findings = []
    for what, meanings in (("turn", _TURNS), ("way", _WAYS)):
        own = [r for r in ratios if r.what == what]
        odd = [(r, m) for r in own for factor, m in meanings.items() if _is_near(r.ratio, factor)]
        if not odd:
            continue
        worst, meaning = odd[0]
        text = f"{worst.one} tells {worst.ratio:.3g} times the {what} of {worst.other}: {meaning}"
        lone = _lone([r for r, _ in odd], [r for r in own if abs(r.ratio - 1.0) < _SAME])
        text += f"; the others side against {lone}" if lone else ""
        findings.append(
            Finding("SR-ODO-003", "error", text, value=worst.ratio, unit="ratio", n=worst.n)
        )
    return tuple(findings)


def _is_near(ratio: float, factor: float) -> bool:
    return abs(ratio / factor - 1.0) < _NEAR


def _lone(odd: list[Ratio], sound: list[Ratio]) -> str | None:
    """The witness that is part of every odd pair, where another pair agrees."""
    if not sound:
        return None
    common = set.intersection(*({r.one, r.other} for r in odd))
    common -= {name for r in sound for name in (r.one, r.other)}
    return common.pop() if len(common) == 1 else None
