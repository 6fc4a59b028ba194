"""Everything that was found, merged by time into one file, and the layout that shows it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from heapq import merge
from itertools import chain
from pathlib import Path

from slamreplay.bundle.run import Run
from slamreplay.bundle.view import BundleView
from slamreplay.evidence.result import Postmortem
from slamreplay.export.foxglove.layout import layout
from slamreplay.export.foxglove.log import McapLog
from slamreplay.export.foxglove.places import places
from slamreplay.export.foxglove.robots import robots
from slamreplay.export.foxglove.seen import seen
from slamreplay.export.foxglove.told import told
from slamreplay.export.notes import verdict_facts
from slamreplay.export.shown import shown

MCAP, LAYOUT, REPORT = "slamreplay.mcap", "layout.json", "report.json"


def write_foxglove(
    post: Postmortem,
    view: BundleView,
    folder: Path,
    *,
    runs: Sequence[Run] = (),
    start_ns: int | None = None,
    end_ns: int | None = None,
    report_json: str | None = None,
) -> None:
    """Write `slamreplay.mcap` and `layout.json` into a folder that exists.

    Streams are merged as they are made, so that no more than some hundred scans are held at once.

    Args:
        post: what was found; its scene adds scans, particles, plans and lanes.
        view: the log, for its maps.
        folder: where to.
        runs: replayed estimators to be laid beside it.
        start_ns: first moment that is written, on the bundle's clock; judged was all of it.
        end_ns: last moment that is written.
        report_json: the report, to be attached.
    """
    what = shown(post, view, runs=runs, start_ns=start_ns, end_ns=end_ns)
    with McapLog(folder / MCAP) as log:
        log.facts("slamreplay", verdict_facts(what))
        if report_json is not None:
            log.attach(what.start_ns, REPORT, "application/json", report_json.encode())
        streams = chain(told(what), places(what), robots(what), seen(what))
        for t_ns, topic, message in merge(*streams, key=lambda sent: sent[0]):
            log.send(t_ns, topic, message)
    text = json.dumps(layout(what, log.schemas), indent=1)
    (folder / LAYOUT).write_text(text + "\n", encoding="utf-8")
