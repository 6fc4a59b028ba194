"""What slamreplay found, as a recording of Rerun's.

Entities are named by what they are in: `map` holds the map, both robots and all that is drawn on
it, a robot's scans lie below the robot, `lanes` are plotted. The one timeline is `log_time`, the
log's own clock. Rerun's library is an extra, larger than all the rest together, and is imported
only where it is used.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from slamreplay.bundle.run import Run
from slamreplay.bundle.view import BundleView
from slamreplay.evidence.result import Postmortem
from slamreplay.export.shown import shown

RRD = "slamreplay.rrd"


def write_rerun(
    post: Postmortem,
    view: BundleView,
    folder: Path,
    *,
    runs: Sequence[Run] = (),
    start_ns: int | None = None,
    end_ns: int | None = None,
) -> None:
    """Write `slamreplay.rrd` into a folder that exists; arguments are those of `write_foxglove`.

    Same findings, same content; Rerun gives each of its chunks an id made of the time of day, so
    that the bytes differ. Whether the library is there `slamreplay.export.formats.needs` asks.
    """
    from slamreplay.export.rerun.places import draw_places
    from slamreplay.export.rerun.plotted import plot
    from slamreplay.export.rerun.robots import draw_robots
    from slamreplay.export.rerun.screen import screen
    from slamreplay.export.rerun.sink import Sink

    what = shown(post, view, runs=runs, start_ns=start_ns, end_ns=end_ns)
    with Sink(folder / RRD, what.post.manifest.bundle_id, screen(what)) as sink:
        plot(what, sink)
        draw_places(what, sink)
        draw_robots(what, sink)
