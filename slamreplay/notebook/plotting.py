"""A report's figures as matplotlib axes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from slamreplay.errors import NotApplicableError, UsageError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from slamreplay.evidence.result import Postmortem
    from slamreplay.report.figures.canvas import Part

#: Panels whose axes stand beside each other, or are long: they get a notebook's whole width.
_WIDE = ("course", "covariance", "consistency", "doses")


def names_of(post: Postmortem) -> list[str]:
    """The panels that a post-mortem has, and after them the single axes of those with several."""
    from slamreplay.report.figures.panels import PANELS

    parts = {name: panel.parts(post) for name, panel in PANELS.items()}
    panels = [name for name, found in parts.items() if found]
    single = [part.name for found in parts.values() if len(found) > 1 for part in found]
    return [*panels, *(name for name in single if name not in panels)]


def draw(post: Postmortem, name: str, ax: Any, width_in: float | None) -> Any:
    """Draw a panel, or one of its parts, into axes that are there or into a figure of pyplot.

    Returns:
        Axes, or an array (N,) of them where the panel has several.

    Raises:
        UsageError: there is no such panel, or the axes are too few or too many.
        NotApplicableError: the log does not have it.
    """
    parts = _parts(post, name)
    if ax is None:
        return _new(post, name, parts, width_in)
    every = _flat(ax)
    if len(every) != len(parts):
        raise UsageError(
            f"'{name}' needs {len(parts)} axes, {len(every)} were given",
            hint=f"its parts are {', '.join(part.name for part in parts)}",
        )
    for part, axes in zip(parts, every, strict=True):
        _fill(part, axes)
    return ax


def _parts(post: Postmortem, name: str) -> tuple[Part, ...]:
    from slamreplay.registry import nearest
    from slamreplay.report.figures.panels import PANELS

    if name in PANELS:
        parts = PANELS[name].parts(post)
    else:
        parts = tuple(p for panel in PANELS.values() for p in panel.parts(post) if p.name == name)
    if parts:
        return parts
    there = names_of(post)
    if name in PANELS:
        raise NotApplicableError(f"this log has no '{name}'", hint=f"it has {', '.join(there)}")
    raise UsageError(f"there is no figure '{name}'", hint=nearest(name, there))


def _new(post: Postmortem, name: str, parts: tuple[Part, ...], width_in: float | None) -> Any:
    """In a figure of its own, which pyplot knows: a notebook shows it when the cell ends."""
    import matplotlib.pyplot as plt
    import numpy as np

    from slamreplay.report.figures import canvas
    from slamreplay.report.figures.panels import PANELS

    width = width_in or (canvas.WIDE if name in _WIDE else canvas.BESIDE)
    with canvas.plain_style():
        if name in PANELS:
            made = PANELS[name].figure(post, width)
            assert made is not None
            axes = [axes for axes in made.axes if axes.get_visible()]
        else:
            made = canvas.new_figure(width, 0.45 * width)
            axes = [made.add_subplot()]
            handles = canvas.draw_parts(parts, axes, canvas.text_size(width))
            canvas.legend(made, handles, canvas.text_size(width), 4)
    _adopt(plt, made)
    return axes[0] if len(axes) == 1 else np.array(axes, dtype=object)


def _adopt(plt: Any, made: Figure) -> None:
    """Let pyplot manage a figure that it did not make: its class may be anything that gives one."""
    plt.figure(FigureClass=lambda *_, **__: made)


def _fill(part: Part, axes: Axes) -> None:
    """Draw and add the legend to the axes themselves."""
    from slamreplay.report.figures import canvas

    size = 8.0
    handles: list[Any] = part.draw(axes, size)
    drawn = axes.legend(handles=handles, fontsize=size - 1.0, labelcolor=canvas.INK,
                        facecolor="white", framealpha=0.85, edgecolor=canvas.RULE)  # fmt: skip
    drawn.set_zorder(9.0)  # above what a map is drawn with


def _flat(ax: Any) -> list[Axes]:
    import numpy as np

    return list(np.asarray(ax, dtype=object).ravel())


class Plot:
    """`report.plot.map()` and so on: `report.figure` by the names that this log has."""

    def __init__(self, report: Any) -> None:
        self._report = report

    def __dir__(self) -> Iterator[str]:
        return iter(self._report.figures)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)

        def plot(ax: Any = None, *, width_in: float | None = None) -> Any:
            return self._report.figure(name, ax, width_in=width_in)

        plot.__name__ = name
        plot.__doc__ = f"Draw '{name}'; as `figure('{name}', ax)`."
        return plot
