"""What a user's editor and type checker know of `import slamreplay as sr`: checked, never run."""

from pathlib import Path
from typing import assert_type

import pandas as pd

import slamreplay as sr
import slamreplay.report.html
from slamreplay.ingest.options import IngestOptions
from slamreplay.notebook import LogBundle, Report, Runs

log = sr.ingest("log.mcap", map="map.yaml")
assert_type(log, LogBundle)
assert_type(log.tables["odometry"], pd.DataFrame)
assert_type(sr.report(log), Report)
assert_type(sr.report(Path("log.mcap")).intervals, pd.DataFrame)
assert_type(sr.perturb(log, ["tf_delay=0.2"], estimators=["amcl"]), Runs)
assert_type(sr.open("out"), LogBundle | Runs | Report)
assert_type(sr.list("labs"), pd.DataFrame)
assert_type(sr.simulate("lost_robot", "lost.mcap", seed=3), Path)
assert_type(sr.export(log, "tum", "out"), list[Path])
options: IngestOptions = IngestOptions()

sr.report(3)  # type: ignore[arg-type]
sr.ingest("log.mcap", maps="map.yaml")  # type: ignore[call-arg]
sr.reprot(log)  # type: ignore[attr-defined]
