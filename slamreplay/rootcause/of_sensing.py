"""What can be put back of sensors and map: wrong stamps, lost scans, people, the old map."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from slamreplay.geometry import se2
from slamreplay.geometry.times import NS_PER_S, ns
from slamreplay.maps.likelihood_field import distance_field
from slamreplay.rootcause.healing import Healed
from slamreplay.rootcause.incident import Incident
from slamreplay.rootcause.trial import Trial
from slamreplay.verdict.causes_scans import near_change
from slamreplay.verdict.judgement import ConstantOffset
from slamreplay.verdict.scan_gaps import scan_gaps
from slamreplay.verdict.words import square_metres

#: Scans of which so much was cut short, for so long, are worth a try.
_CUT, _CUT_ROWS = 0.2, 10
#: Log odds of a map that is contradicted where the belief left the truth.
_CHANGED = 3.0


def clocks(incident: Incident, healed: Healed) -> Iterator[Trial]:
    """The stamps as they are: each scan meets the odometry of another moment."""
    delay = incident.case.delay
    if delay is None or not delay.is_significant:
        return
    t, path = incident.t_ns, healed.evidence.odometry
    met = se2.interpolate(t, path, np.clip(t + ns(delay.seconds), t[0], t[-1]))
    name = "scan_delay.stamp" if delay.seconds > 0 else "tf_delay.odometry"
    told = replace(healed.evidence, odometry=met)
    words = f"stamps as recorded ({delay.text})"
    # The verdict asks a belief of late scans for the moment at which they were taken.
    late_ns = ns(delay.seconds) if delay.seconds > 0.0 and delay.late != "odometry" else 0
    seconds = abs(delay.seconds)
    yield Trial(name, "timing", seconds, "s", None, words, told, late_ns=late_ns)


def gaps(incident: Incident, healed: Healed) -> Iterator[Trial]:
    """The scans that never came."""
    t = incident.t_ns
    found = scan_gaps(incident.view, int(t[0]), int(t[-1]), recorded=incident.case.recorded)
    if not incident.missing.any() or not found:
        return
    rows = zip(healed.evidence.beams, incident.missing, strict=True)
    beams = tuple(None if gone else one for one, gone in rows)
    worst = max(found, key=lambda gap: gap.end_ns - gap.start_ns)
    seconds = (worst.end_ns - worst.start_ns) / NS_PER_S
    at, words = incident.row_at(worst.start_ns), worst.text(incident.case.start_ns)
    told = replace(healed.evidence, beams=beams)
    yield Trial("scan_drop.burst", "timing", seconds, "s", at, f"missing scans ({words})", told)


def people(incident: Incident, healed: Healed) -> Iterator[Trial]:
    """The beams that something cut short which is in no map."""
    with np.errstate(invalid="ignore"):
        cut = healed.cut_share >= _CUT
    if cut.sum() < _CUT_ROWS:
        return
    rows = np.flatnonzero(cut)
    share = float(np.mean(healed.cut_share[rows]))
    words = f"what cut {100 * share:.0f} % of the beams short"
    told = replace(healed.evidence, beams=healed.told_beams)
    # What stands where the map has nothing cuts beams, too.
    odds = -_CHANGED if near_change(incident.case, incident.onset_ns) else 0.0
    name, row = "people.hidden", int(rows[0])
    yield Trial(name, "association_error", share, "ratio", row, words, told, log_dose=odds)


def maps(incident: Incident, healed: Healed, offset: ConstantOffset | None) -> Iterator[Trial]:
    """The map as the robot had it, or one that lies elsewhere."""
    e, changes = healed.evidence, incident.case.hindsight.changes
    old = healed.told_grid
    if changes is not None and not np.array_equal(e.grid.cells, old.cells):
        area = sum(r.area_m2 for r in changes.regions)
        words = f"the map as the robot had it, {square_metres(area)} of which is no longer true"
        odds = _CHANGED if near_change(incident.case, incident.onset_ns) else -1.0
        far = distance_field(old, e.config.laser_likelihood_max_dist)
        told = replace(e, grid=old, distance_m=far)
        name = "map_stale.versions"
        yield Trial(name, "stale_map_use", 1.0, "ratio", None, words, told, log_dose=odds)
    if offset is not None and offset.cause == "map":
        words = f"a map that lies elsewhere ({offset.text})"
        said = se2.compose(np.array(offset.xyyaw), healed.truth)
        x, y, _ = offset.xyyaw
        name, size = ("map_shift.x", x) if abs(x) >= abs(y) else ("map_shift.y", y)
        yield Trial(name, "wrong_map", size, "m", None, words, belief=said)
