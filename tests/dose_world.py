"""An estimator that is wrong by what it is told, and perturbations that tell it."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from slamreplay.bundle.run import Estimate
from slamreplay.bundle.scans import scan_set
from slamreplay.bundle.track import PoseTrack
from slamreplay.errors import NotApplicableError
from slamreplay.perturb.variant import Variant, check_level
from slamreplay.testing.synthetic import START_NS, true_path

OFF, BLIND = "told_off_m", "told_blind"


@dataclass(frozen=True)
class Told:
    """At the truth, but for a setting in metres; nothing is drawn."""

    name: ClassVar[str] = "told"
    needs: ClassVar[frozenset[str]] = frozenset({"scans"})
    settings: ClassVar[frozenset[str]] = frozenset({OFF, BLIND})
    scatter_m: ClassVar[float] = 0.0
    frame: ClassVar[str] = "map"

    def run(self, view, *, seed):
        t_ns = scan_set(view).t_ns
        xyyaw = true_path((t_ns - START_NS) / 1e9)
        xyyaw[:, 0] += view.settings.get(OFF, 0.0)
        if self.scatter_m:
            xyyaw[:, 0] += self.scatter_m * (1 + np.random.default_rng(seed).random())
        if view.settings.get(BLIND):
            xyyaw[:] = np.nan
        cov = np.broadcast_to(np.diag([0.01, 0.01, 0.001]), (len(t_ns), 3, 3)).copy()
        cov[:, 0, 0] += 1e-6 * np.arange(len(t_ns))
        return Estimate(PoseTrack(self.frame, "base_link", t_ns, xyyaw, cov))


@dataclass(frozen=True)
class Scattered(Told):
    """The same, off by a number that the seed draws."""

    name: ClassVar[str] = "scattered"
    scatter_m: ClassVar[float] = 0.1


@dataclass(frozen=True)
class Elsewhere(Told):
    """The same in a frame of its own."""

    name: ClassVar[str] = "elsewhere"
    frame: ClassVar[str] = "odom"


@dataclass(frozen=True)
class Deaf(Told):
    """It is never wrong, whatever it is told."""

    name: ClassVar[str] = "deaf"

    def run(self, view, *, seed):
        return super().run(view.bundle.view(), seed=seed)


@dataclass(frozen=True)
class Wrong:
    """What the estimator is told."""

    name: ClassVar[str] = "wrong"
    variants: ClassVar[dict] = {
        "by": Variant("m", 0.0, "off by this much", -100, 100),
        "shrunk": Variant("ratio", 1.0, "off by as much as this lacks", 0, 2),
        "drawn": Variant("m", 0.0, "off by one to two times this much, as the seed draws", 0, 100),
        "hump": Variant("m", 0.0, "off by this much, but for more than 5 m", 0, 100),
        "blind": Variant("m", 0.0, "no pose from 3 m on", 0, 100),
        "short": Variant("s", 0.0, "not for this log from 3 s on", 0, 100),
        "unsure": Variant("m", 0.0, "off by this much, some seeds not from 1 m on", 0, 100),
        "leaky": Variant("m", 0.0, "off by this much and a bit", 0, 100),
    }
    touches: ClassVar[frozenset[str]] = frozenset({OFF})

    def apply(self, view, variant, level, rng):
        baseline = check_level(self.name, self.variants, variant, level).baseline
        if variant == "leaky":
            return view.with_setting(OFF, level + 1e-6)
        if level == baseline:
            return view
        if variant == "short" and level >= 3.0:
            raise NotApplicableError("the log is too short")
        if variant == "unsure" and level >= 1.0 and rng.random() < 0.5:
            raise NotApplicableError("this seed refuses")
        if variant == "blind":
            return view.with_setting(BLIND, float(level >= 3.0))
        off = {
            "by": level,
            "shrunk": 10.0 * (1.0 - level),
            "drawn": level * (1.0 + rng.random()) if variant == "drawn" else 0.0,
            "hump": level if level <= 5.0 else 0.0,
            "short": level,
            "unsure": level,
        }[variant]
        return view.with_setting(OFF, off)
