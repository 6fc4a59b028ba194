"""Replay the evidence of a robot log and say whether the robot was lost or the map had changed.

In a notebook or a script, `import slamreplay as sr`, then:

    sr.ingest("log.mcap", map="map.yaml")   a log as tables
    sr.report("log.mcap")                   the verdict, its evidence and its figures
    sr.perturb(log, ["tf_delay=0.2"])       estimators run again, one thing changed at a time
    sr.export(log, "tum", "out")            files for other tools
    sr.simulate("lost_robot", "log.mcap")   a log whose truth is known
    sr.open("out/report")                   a bundle, runs or a report that were written before
    sr.list("perturbations"), sr.explain("SR-LOC-001")
"""

from typing import TYPE_CHECKING

from slamreplay.version import __version__ as __version__

if TYPE_CHECKING:
    from slamreplay.errors import SlamreplayError as SlamreplayError
    from slamreplay.notebook import explain as explain
    from slamreplay.notebook import export as export
    from slamreplay.notebook import ingest as ingest
    from slamreplay.notebook import list as list  # noqa: A004
    from slamreplay.notebook import open as open  # noqa: A004
    from slamreplay.notebook import perturb as perturb
    from slamreplay.notebook import report as report
    from slamreplay.notebook import simulate as simulate
else:
    # Nothing is imported before it is asked for: the command line's --help comes by here, too.
    _STAGES = ("ingest", "report", "perturb", "export", "simulate")
    _OTHERS = {
        "open": "slamreplay.notebook",
        "list": "slamreplay.notebook",
        "explain": "slamreplay.notebook",
        "SlamreplayError": "slamreplay.errors",
    }

    def __getattr__(name):
        from importlib import import_module

        if name in _STAGES:
            return import_module(f"slamreplay.{name}")
        if name in _OTHERS:
            return getattr(import_module(_OTHERS[name]), name)
        raise AttributeError(f"module 'slamreplay' has no attribute '{name}'")

    def __dir__():
        return sorted([*_STAGES, *_OTHERS, "__doc__", "__version__"])
