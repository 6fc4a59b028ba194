"""Which sequence of places explains all submaps and the motion between them best (Viterbi)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.geometry import se2

#: A submap's mean score times this is its log-likelihood: some 120 independent points.
WEIGHT = 120.0
SIGMA_M, SIGMA_RAD = 0.2, 0.08
#: The cost at which a jump is believed (a kidnapped robot), where the chain of scans in between is
#: solid (scans and odometry agree: it takes several submaps' evidence), doubtful, or broken.
JUMP_SOLID, JUMP_DOUBTFUL, JUMP_BROKEN = 100.0, 25.0, 8.0
#: Two places are different places beyond this.
APART_M, APART_RAD = 0.5, 0.35


@dataclass(frozen=True, eq=False)
class Hypotheses:
    """Candidate poses of one submap's reference keyframe and their scores in 0 to 1.

    Attributes:
        xyyaw: (H, 3) poses.
        score: (H,) how well each fits.
        chance: what this submap scores somewhere on this map by chance; a place that fits worse
            is no less likely for it. -inf where the whole map was not searched.
    """

    xyyaw: se2.Array
    score: se2.Array
    chance: float = float("-inf")

    @property
    def log_likelihood(self) -> se2.Array:
        """(H,) up to a constant."""
        return np.asarray(WEIGHT * np.maximum(self.score, self.chance))


@dataclass(frozen=True, eq=False)
class Places:
    """The best sequence.

    Attributes:
        chosen: (S,) index of the hypothesis of each submap.
        xyyaw: (S, 3) its pose.
        score: (S,) its score.
        jumps: (S - 1,) the motion to the next submap is not the measured one.
        margin: mean score per submap by which it beats the best sequence that differs everywhere;
            None where there is no such sequence.
        doubt: (S,) log-likelihood by which it beats the best sequence that differs at this submap;
            inf where there is none.
        total: log-likelihood of the sequence, up to a constant.
    """

    chosen: NDArray[np.int64]
    xyyaw: se2.Array
    score: se2.Array
    jumps: NDArray[np.bool_]
    margin: float | None
    doubt: se2.Array
    total: float = 0.0


def best_places(
    hypotheses: Sequence[Hypotheses], motions: se2.Array, jump_cost: se2.Array
) -> Places:
    """The most probable sequence of hypotheses.

    Args:
        hypotheses: of S >= 1 submaps, each with at least one.
        motions: (S - 1, 3) measured motion from each submap's reference to the next one's.
        jump_cost: (S - 1,) what it costs to believe that it moved otherwise.
    """
    unary, pairs = _likelihoods(hypotheses, motions, jump_cost)
    chosen, total, through = _viterbi(unary, pairs)
    poses = np.array([h.xyyaw[i] for h, i in zip(hypotheses, chosen, strict=True)])
    different = [_differs(h.xyyaw, pose) for h, pose in zip(hypotheses, poses, strict=True)]
    other = _barred(unary, pairs, different)
    margin = None if other is None else float((total - other) / (WEIGHT * len(hypotheses)))
    doubt = np.array(
        [total - t[d].max() if d.any() else np.inf for t, d in zip(through, different, strict=True)]
    )
    jumps = np.array(
        [
            pair[a, b] <= 1e-9 - cost
            for pair, a, b, cost in zip(pairs, chosen[:-1], chosen[1:], jump_cost, strict=True)
        ],
        dtype=bool,
    )
    score = np.array([h.score[i] for h, i in zip(hypotheses, chosen, strict=True)])
    return Places(chosen, poses, score, jumps, margin, doubt, total)


def best_different(
    hypotheses: Sequence[Hypotheses], motions: se2.Array, jump_cost: se2.Array, poses: se2.Array
) -> float | None:
    """Log-likelihood of the best sequence that differs everywhere from `poses` (S, 3).

    On the scale of `Places.total`; None where there is no such sequence.
    """
    unary, pairs = _likelihoods(hypotheses, motions, jump_cost)
    different = [_differs(h.xyyaw, pose) for h, pose in zip(hypotheses, poses, strict=True)]
    return _barred(unary, pairs, different)


def _likelihoods(
    hypotheses: Sequence[Hypotheses], motions: se2.Array, jump_cost: se2.Array
) -> tuple[list[se2.Array], list[se2.Array]]:
    """Log-likelihoods of each submap's hypotheses and of each pair of neighbours'."""
    unary = [h.log_likelihood for h in hypotheses]
    pairs = []
    for s, motion in enumerate(motions):
        expected = se2.compose(hypotheses[s].xyyaw, motion)
        miss = se2.between(expected[:, None, :], hypotheses[s + 1].xyyaw[None, :, :])
        cost = ((miss / np.array([SIGMA_M, SIGMA_M, SIGMA_RAD])) ** 2).sum(axis=-1)
        pairs.append(-np.minimum(0.5 * cost, jump_cost[s]))
    return unary, pairs


def _barred(
    unary: Sequence[se2.Array], pairs: Sequence[se2.Array], different: Sequence[NDArray[np.bool_]]
) -> float | None:
    """Value of the best path through hypotheses under the masks."""
    if not all(d.any() for d in different):
        return None
    barred = [np.where(d, u, -np.inf) for d, u in zip(different, unary, strict=True)]
    return _viterbi(barred, pairs)[1]


def _differs(xyyaw: se2.Array, pose: se2.Array) -> NDArray[np.bool_]:
    apart = np.hypot(*(xyyaw[:, :2] - pose[:2]).T) > APART_M
    return np.asarray(apart | (np.abs(se2.wrap_angle(xyyaw[:, 2] - pose[2])) > APART_RAD))


def _viterbi(
    unary: Sequence[se2.Array], pairs: Sequence[se2.Array]
) -> tuple[NDArray[np.int64], float, list[se2.Array]]:
    """Best path, its value, and for each state the value of the best path through it."""
    ahead = [unary[0]]
    came: list[NDArray[np.int64]] = []
    for u, pair in zip(unary[1:], pairs, strict=True):
        step = ahead[-1][:, None] + pair
        came.append(step.argmax(axis=0))
        ahead.append(u + step.max(axis=0))
    behind = [np.zeros(len(unary[-1]))]
    for u, pair in zip(unary[:0:-1], pairs[::-1], strict=True):
        behind.append((pair + (u + behind[-1])[None, :]).max(axis=1))
    through = [a + b for a, b in zip(ahead, behind[::-1], strict=True)]
    path = [int(ahead[-1].argmax())]
    for back in came[::-1]:
        path.append(int(back[path[-1]]))
    return np.array(path[::-1], dtype=np.int64), float(ahead[-1].max()), through
