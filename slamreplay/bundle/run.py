"""A trial, what an estimator produced in it, and their files."""

from __future__ import annotations

import hashlib
import io
import json
import tokenize
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.track import PoseTrack
from slamreplay.errors import BundleError
from slamreplay.geometry.covariance import is_positive_definite
from slamreplay.geometry.se2 import Array

RUN_FORMAT = 2


@dataclass(frozen=True)
class Trial:
    """A bundle, an estimator, a seed, and at most one perturbation: the type holds no second one.

    What the estimator was configured with is the same in every trial that is laid beside another.

    Attributes:
        bundle_id: which evidence.
        estimator: name in the estimator registry.
        seed: of every random number in the trial.
        perturbation: `NAME.VARIANT`, or None for the baseline.
        level: the perturbation's one number, in `unit`; None for the baseline.
        unit: s, m, deg or ratio.
        parameters: of the estimator, as canonical JSON; empty where it ran with its defaults.
    """

    bundle_id: str
    estimator: str
    seed: int
    perturbation: str | None = None
    level: float | None = None
    unit: str = ""
    parameters: str = ""

    @property
    def record(self) -> dict[str, Any]:
        """Every attribute for a file; `parameters` only where there are some."""
        told = asdict(self)
        if not self.parameters:
            del told["parameters"]
        return told

    @property
    def given(self) -> dict[str, Any] | None:
        """The estimator's parameters by name; None where it ran with its defaults."""
        return json.loads(self.parameters) if self.parameters else None

    @property
    def id(self) -> str:
        """Short hash that names the trial's files."""
        return hashlib.sha256(json.dumps(self.record).encode()).hexdigest()[:16]


@dataclass(frozen=True, eq=False)
class Innovations:
    """What each measurement said against the prediction, one source per set: the residual ledger.

    Attributes:
        source: table or sensor.
        t_ns: (N,) times.
        residual: (N, m) measured minus predicted.
        S: (N, m, m) covariance predicted for it, from the prior.
        accepted: (N,) whether the update used it.
        axes: m names of what was measured, with their units: "range m"; empty where not told.
        frame_id: frame in whose axes the residual is; empty where not told.
        moved: (N, 3) belief after minus before, x y in the belief's frame and wrapped yaw; NaN
            where that is not known.
        about: (N,) what was measured: a landmark's name, the two ends of a closure; may be empty.
        score: (N,) how well a match fits, 0 to 1; NaN where nothing was matched.
        is_predicted: whether S is what the estimator itself predicted, so that NIS may judge it;
            otherwise it is made for the ledger only.
    """

    source: str
    t_ns: NDArray[np.int64]
    residual: Array
    S: Array
    accepted: NDArray[np.bool_]
    axes: tuple[str, ...] = ()
    frame_id: str = ""
    moved: Array = field(default_factory=lambda: np.empty((0, 3)))
    about: NDArray[np.str_] = field(default_factory=lambda: np.empty(0, dtype="U1"))
    score: Array = field(default_factory=lambda: np.empty(0))
    is_predicted: bool = True

    def __post_init__(self) -> None:
        n = len(self.t_ns)
        empty = {"moved": (n, 3), "score": (n,)}
        for name, shape in empty.items():
            if np.shape(getattr(self, name)) != shape and not len(getattr(self, name)):
                object.__setattr__(self, name, np.full(shape, np.nan))
        about = np.asarray(self.about, dtype=np.str_)
        object.__setattr__(self, "about", about if len(about) else np.full(n, ""))

    @property
    def nis(self) -> Array:
        """(N,) normalised innovation squared r' S^-1 r; NaN where S is no covariance."""
        return self.nis_of(slice(None))

    def nis_of(self, rows: NDArray[np.int64] | slice) -> Array:
        """The same of some rows alone."""
        S, r = np.asarray(self.S)[rows], np.asarray(self.residual)[rows]
        known = is_positive_definite(S) & np.isfinite(r).all(axis=1)
        out = np.full(len(r), np.nan)
        L = np.linalg.cholesky(S[known])
        white = np.linalg.solve(L, r[known, :, None])[..., 0]
        out[known] = (white**2).sum(axis=1)
        return out


@dataclass(frozen=True, eq=False)
class Estimate:
    """What an estimator gives back.

    Attributes:
        track: belief, one row per scan in processing order (odometry rows where no scan is).
        innovations: by source, where the estimator has them.
        diagnostics: further columns (N,) by name: particles, effective sample size, updates.
        scalars: further numbers of the whole run by name: what was counted or fitted.
    """

    track: PoseTrack
    innovations: tuple[Innovations, ...] = ()
    diagnostics: Mapping[str, Array] = field(default_factory=dict)
    scalars: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Run:
    """An estimate and the trial it came from; `not_applicable` says why there is no estimate."""

    trial: Trial
    estimate: Estimate | None
    not_applicable: str | None = None


def run_bytes(run: Run) -> bytes:
    """The run as one uncompressed npz with a json header: same run, same bytes."""
    arrays: dict[str, NDArray] = {}
    head: dict[str, object] = {
        "run_format": RUN_FORMAT,
        "trial": run.trial.record,
        "not_applicable": run.not_applicable,
    }
    if run.estimate is not None:
        track = run.estimate.track
        head["frames"] = [track.frame_id, track.child_frame_id]
        arrays |= {"t_ns": track.t_ns, "xyyaw": track.xyyaw, "cov": track.cov}
        head["innovations"] = [i.source for i in run.estimate.innovations]
        head["axes"] = [i.axes for i in run.estimate.innovations]
        head["frame_ids"] = [i.frame_id for i in run.estimate.innovations]
        head["are_predicted"] = [i.is_predicted for i in run.estimate.innovations]
        head["scalars"] = dict(run.estimate.scalars)
        for k, i in enumerate(run.estimate.innovations):
            arrays |= {f"innovation{k}.{n}": getattr(i, n) for n in _INNOVATION}
        arrays |= {f"diagnostic.{k}": v for k, v in sorted(run.estimate.diagnostics.items())}
    text = json.dumps(head, sort_keys=True).encode()
    arrays["head"] = np.frombuffer(text, dtype=np.uint8)
    sink = io.BytesIO()
    np.savez(sink, allow_pickle=False, **arrays)  # zip entries carry a fixed date: deterministic
    return sink.getvalue()


#: What a file that was cut short, or has a wrong byte somewhere, makes numpy and zipfile raise.
_DAMAGED = (
    OSError, EOFError, ValueError, LookupError, TypeError, AttributeError, NotImplementedError,
    RuntimeError, MemoryError, tokenize.TokenError, zipfile.BadZipFile, zlib.error,
)  # fmt: skip


def read_run(path: Path) -> Run:
    """A run from its file.

    Raises:
        BundleError: unreadable, or written by another version.
    """
    try:
        # Not by its name: numpy leaves a file open that it cannot read.
        with np.load(io.BytesIO(path.read_bytes()), allow_pickle=False) as arrays:
            head = json.loads(arrays["head"].tobytes())
            if head["run_format"] != RUN_FORMAT:
                raise BundleError(
                    f"run format {head['run_format']}, this program reads {RUN_FORMAT}",
                    where=path,
                    hint="run perturb again",
                )
            trial = Trial(**head["trial"])
            if "frames" not in head:
                return Run(trial, None, head["not_applicable"])
            frame, child = head["frames"]
            track = PoseTrack(frame, child, arrays["t_ns"], arrays["xyyaw"], arrays["cov"])
            innovations = tuple(
                _innovations(head, arrays, k) for k in range(len(head["innovations"]))
            )
            diagnostics = {
                name.removeprefix("diagnostic."): arrays[name]
                for name in arrays.files
                if name.startswith("diagnostic.")
            }
            scalars = {str(k): float(v) for k, v in head["scalars"].items()}
    except _DAMAGED as error:
        raise BundleError("not a readable run", where=path) from error
    estimate = Estimate(track, innovations, diagnostics, scalars)
    return Run(trial, estimate, head["not_applicable"])


def _innovations(head: Mapping[str, Any], arrays: Any, k: int) -> Innovations:
    return Innovations(
        head["innovations"][k],
        **{name: arrays[f"innovation{k}.{name}"] for name in _INNOVATION},
        axes=tuple(head["axes"][k]),
        frame_id=head["frame_ids"][k],
        is_predicted=head["are_predicted"][k],
    )


_INNOVATION = ("t_ns", "residual", "S", "accepted", "moved", "about", "score")
