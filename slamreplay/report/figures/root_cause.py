"""Which single cause reproduces what went wrong: the probability of each that was tried."""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from slamreplay.evidence.result import Postmortem
from slamreplay.evidence.words import FAILURE_MODES
from slamreplay.report.figures import canvas
from slamreplay.report.figures.canvas import BLUE, INK, VERMILLION, Part
from slamreplay.rootcause.result import Candidate, RootCause

#: Bars, the most probable first; what is left has nearly nothing.
_BARS = 8


def cause_figure(post: Postmortem, width_in: float) -> Figure | None:
    """A bar for each cause; None where nothing was replayed."""
    parts = cause_parts(post)
    if not parts:
        return None
    size = canvas.text_size(width_in)
    assert post.root_cause is not None
    bars = min(len(post.root_cause.candidates), _BARS)
    figure = canvas.new_figure(width_in, 0.9 + 0.38 * bars)
    handles = canvas.draw_parts(parts, [figure.add_subplot()], size)
    canvas.legend(figure, handles, size, columns=2)
    return figure


def cause_parts(post: Postmortem) -> tuple[Part, ...]:
    """The bars; nothing where nothing was replayed."""
    cause = post.root_cause
    if cause is None or not cause.trials or not cause.candidates:
        return ()
    return (Part("root_cause", lambda axes, size: _draw(axes, cause, size)),)


def _draw(axes: Axes, cause: RootCause, size: float) -> list[object]:
    shown = cause.candidates[:_BARS]
    canvas.dress(axes, "probability [1]", "", size)
    axes.grid(visible=False, axis="y")
    for row, one in enumerate(shown):
        colour = VERMILLION if one.kind == cause.began_as else BLUE
        axes.barh(row, one.probability, 0.62, color=colour, alpha=0.75, zorder=2)
        is_long = one.probability > 0.85
        axes.text(one.probability + (-0.02 if is_long else 0.02), row, f"{one.probability:.2f}",
                  fontsize=size, color="white" if is_long else INK, zorder=3,
                  ha="right" if is_long else "left", va="center_baseline")  # fmt: skip
    axes.set_yticks(range(len(shown)), [_name(one) for one in shown])
    axes.tick_params(axis="y", labelcolor=INK, labelsize=size - 1.0, length=0)
    axes.set_xlim(0.0, 1.0)
    axes.set_ylim(len(shown) - 0.4, -0.6)
    return [
        Patch(color=VERMILLION, alpha=0.75, label="named as the root cause"),
        Patch(color=BLUE, alpha=0.75, label="another cause"),
    ]


def _name(one: Candidate) -> str:
    """How it began, and below it what was put back."""
    name = "no single thing" if one.kind == "none" else FAILURE_MODES[one.kind]
    if one.perturbation is None:
        return name
    much = "" if one.level is None else f" {one.level:.3g} {one.unit}".replace(" ratio", "")
    return f"{name}\n{one.perturbation}{much}"
