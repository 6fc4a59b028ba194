"""When the error outgrew the covariance: what evidence says against a belief's sigma."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from slamreplay.bundle.track import PoseTrack
from slamreplay.consistency.answers import P_ACCUSE
from slamreplay.consistency.belief.collapse.episodes import Episode, Scan, scan
from slamreplay.consistency.belief.collapse.size import heading_sigma, position_sigma
from slamreplay.consistency.belief.collapse.stretch import Stretch
from slamreplay.consistency.belief.credibility import GROSS
from slamreplay.consistency.evidence.source import Evidence
from slamreplay.consistency.statistics.mean_test import mean_test
from slamreplay.consistency.statistics.whitening import whitened
from slamreplay.geometry.se2 import Array

#: A belief's ordinary level is told by this share of its rows, those with the smallest errors.
_ORDINARY = 0.2
#: What was before the onset is told by so many rows.
_BEFORE = 10
#: What changed by less than this factor stayed.
_STAYED = 1.25


@dataclass(frozen=True, eq=False)
class _Series:
    """The errors of the position or the heading against one source.

    Attributes:
        evidence: the source.
        part: position or heading.
        t_ns: (M,) times of the rows that can be judged.
        size: (M,) length of the error, m or rad.
        white: (M, m) whitened.
    """

    evidence: Evidence
    part: str
    t_ns: NDArray[np.int64]
    size: Array
    white: Array


def outgrown(
    updates: PoseTrack, evidence: tuple[Evidence, ...]
) -> tuple[list[Stretch], float | None]:
    """Stretches in which the error left what its covariance allows, and the p-value of the rest.

    Sources that share no evidence with the belief are asked; where none of them has the covariance
    that it claims, but only a bound of it, another as well, against which only a sigma too small by
    `GROSS` counts.
    Position and heading are looked at apart: of a consistent belief either is consistent, whether
    they are coupled or not. P-values are multiplied by the number of series that were looked at.

    Args:
        updates: the belief's own rows, for what its sigma did.
        evidence: its errors, the best source first.

    Returns:
        The stretches; and the p-value of the most striking window where there is no stretch (1
        where it is one that is not told), None where there was nothing to look at.
    """
    independent = [s for e in evidence if not e.shared for s in _series(e)]
    shared = next((rows for e in evidence if e.shared and (rows := list(_series(e)))), [])
    told = any(series.evidence.is_exact for series in independent)
    asked = independent if told else [*independent, *shared]
    found, least = [], 1.0
    for series in asked:
        looked = _look(series.white)
        least = min(least, looked.p_value * len(asked))
        for episode in looked.episodes:
            episode = replace(episode, p_value=episode.p_value * len(asked))
            if episode.p_value < P_ACCUSE and (
                not series.evidence.shared or episode.factor >= GROSS
            ):
                found.append(_stretch(updates, series, episode))
    if found or not asked:
        return found, None
    return found, least if least >= P_ACCUSE else 1.0


def _series(e: Evidence) -> Iterator[_Series]:
    position = [axis.endswith(" m") for axis in e.axes]
    heading = [axis.startswith(("yaw", "rz")) for axis in e.axes]
    for part, mask in (("position", position), ("heading", heading)):
        axes = np.flatnonzero(mask)
        if not len(axes):
            continue
        error = e.error[:, axes]
        white = whitened(error, e.cov[:, axes][:, :, axes])
        rows = np.isfinite(white).all(axis=1)
        if rows.any():
            size = np.sqrt(np.sum(error[rows] ** 2, axis=1))
            yield _Series(e, part, e.t_ns[rows], size, white[rows])


def _look(white: Array) -> Scan:
    """Episodes beyond the belief's ordinary level, where that is told by the mean over the log.

    A belief that is too sure of itself all the time has not collapsed: SR-CON-001 names its factor.
    Where that cannot judge the mean nobody would, and all of it is looked at.
    """
    looked = scan(white)
    if not looked.episodes or not mean_test(white).sufficient:
        return looked
    dof = white.shape[1]
    ordinary = float(np.quantile(np.sum(white**2, axis=1), _ORDINARY))
    level = math.sqrt(max(1.0, ordinary / float(chdtri(dof, 1.0 - _ORDINARY))))
    looked = scan(white / level)
    episodes = (replace(e, factor=e.factor * level) for e in looked.episodes)
    return Scan(tuple(episodes), looked.p_value)


def _stretch(updates: PoseTrack, series: _Series, episode: Episode) -> Stretch:
    inside = slice(episode.first, episode.last + 1)
    before = slice(max(0, episode.first - _BEFORE), episode.first)
    most = math.sqrt(float(np.sum(series.white[inside] ** 2, axis=1).max()))
    source, shared = series.evidence.source, series.evidence.shared
    text = f"{_sigma_words(updates, series, before, inside)} while the error against {source} "
    text += f"{_error_words(series, before, inside)} ({most:.2g} sigma), too small by a factor of "
    text += f"{episode.factor:.2g}"
    if shared:
        text += f" ({source} shares evidence with the belief: it proves nothing where it is silent)"
    t_ns = series.t_ns[inside]
    return Stretch(
        int(t_ns[0]), int(t_ns[-1]), {series.part: text}, len(t_ns), episode.factor,
        episode.p_value, independent=not shared,
    )  # fmt: skip


def _sigma_words(updates: PoseTrack, series: _Series, before: slice, inside: slice) -> str:
    """What the belief's own sigma did: "sigma of the position stayed at 0.02 m"."""
    part = series.part
    size = position_sigma(updates.cov) if part == "position" else heading_sigma(updates.cov)
    size = size[np.maximum(np.searchsorted(updates.t_ns, series.t_ns, side="right") - 1, 0)]
    during, text = size[inside], f"sigma of the {part}"
    was = float(np.median(size[before])) if before.stop else float(during[0])
    usual, most = float(np.median(during)), float(during.max())
    if usual * _STAYED < was:
        return f"{text} shrank from {_amount(was, part)} to {_amount(usual, part)}"
    if usual > was * _STAYED:
        return f"{text} only grew from {_amount(was, part)} to {_amount(most, part)}"
    return f"{text} stayed at {_amount(usual, part)}"


def _error_words(series: _Series, before: slice, inside: slice) -> str:
    most = float(series.size[inside].max())
    was = float(np.median(series.size[before])) if before.stop else most
    if most > was * _STAYED:
        return f"grew from {_amount(was, series.part)} to {_amount(most, series.part)}"
    return f"was up to {_amount(most, series.part)}"


def _amount(value: float, part: str) -> str:
    if part == "heading":
        return f"{math.degrees(value):.2g} deg"
    return f"{value:.2f} m" if value >= 0.1 else f"{value:.2g} m"
