"""slamreplay in a notebook: bundles, runs and reports as values that show themselves.

Whoever writes `import slamreplay as sr` gets the functions of this package as `sr.report` and so
on. Tables are pandas DataFrames: times both as int64 ns on the bundle's clock (`..._ns`) and as
seconds since the log's start (`..._s`, for reading and plotting), the unit of every column in
`frame.attrs["units"]`. Figures are matplotlib axes. Heavy libraries are imported by the functions
that need them: importing this package costs next to nothing.
"""

from slamreplay.notebook.catalogue import explain
from slamreplay.notebook.catalogue import list_ as list  # noqa: A004
from slamreplay.notebook.exporting import export
from slamreplay.notebook.log_bundle import LogBundle
from slamreplay.notebook.opening import open_ as open  # noqa: A004
from slamreplay.notebook.reading import ingest
from slamreplay.notebook.report_value import Report
from slamreplay.notebook.reporting import report
from slamreplay.notebook.running import perturb
from slamreplay.notebook.runs_value import Runs
from slamreplay.notebook.simulating import simulate

__all__ = [
    "LogBundle",
    "Report",
    "Runs",
    "explain",
    "export",
    "ingest",
    "list",
    "open",
    "perturb",
    "report",
    "simulate",
]
