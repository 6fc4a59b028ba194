"""Whether anything in a trial is drawn at random: of what is not, one run stands for all seeds."""

from __future__ import annotations

import numpy as np

from slamreplay.bundle.view import BundleView
from slamreplay.doses.plan import Axis
from slamreplay.errors import NotApplicableError
from slamreplay.perturb import PERTURBATIONS


def draws(view: BundleView, axis: Axis) -> bool:
    """Whether a perturbation draws random numbers, tried at its greatest level.

    The generator that it is given tells: its state has moved, or it has children.

    Args:
        view: the evidence.
        axis: the perturbation; one that is not applicable draws nothing.
    """
    name, _, variant = axis.perturbation.partition(".")
    rng = np.random.Generator(np.random.PCG64(0))
    before = str(rng.bit_generator.state)
    try:
        PERTURBATIONS.load(name)().apply(view, variant, axis.levels[-1], rng)
    except NotApplicableError:
        return False
    children: int = getattr(rng.bit_generator.seed_seq, "n_children_spawned", 0)
    return str(rng.bit_generator.state) != before or children > 0
