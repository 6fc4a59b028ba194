"""Figures as files for papers and tickets: PNG, SVG and captions, a folder whole or absent.

The SVG is what a paper takes in and sets its own caption under: it carries the caption as title and
description only. The PNG is what is pasted into a ticket or a chat and forwarded alone: there the
caption is drawn below the picture, so that it still says which log it is of.
"""

from __future__ import annotations

import json
from pathlib import Path

from slamreplay.bundle.atomic import atomic_folder, check_target
from slamreplay.errors import UsageError
from slamreplay.evidence.clean import as_markdown
from slamreplay.evidence.result import Postmortem
from slamreplay.report.figures import canvas
from slamreplay.report.figures.panels import PANELS, Panel, caption
from slamreplay.report.figures.written import captioned_png, captioned_svg
from slamreplay.version import __version__

#: By this file a folder of figures is known; it lists them for programs.
MARKER = "figures.json"
CAPTIONS = "captions.md"


def write_figures(post: Postmortem, target: Path) -> list[Path]:
    """Write every panel that the log has.

    Args:
        post: the post-mortem; the same one gives the same bytes.
        target: folder; one of figures that is there already is replaced in one step.

    Returns:
        The paths of all files, the captions last.

    Raises:
        OutputError: the folder is somebody else's or cannot be written.
    """
    content: dict[str, bytes] = {}
    listed: list[dict[str, object]] = []
    for panel in PANELS.values():
        made = _files(post, panel)
        if made is None:
            continue
        content |= made
        told = caption(panel, post)
        listed.append({"name": panel.name, "title": panel.title, "files": [*made],
                       "width_in": panel.width_in, "caption": told})  # fmt: skip
    head = {"slamreplay": __version__, "bundle": post.manifest.bundle_id, "figures": listed}
    content[CAPTIONS] = _captions(listed).encode()
    content[MARKER] = (json.dumps(head, indent=1, ensure_ascii=False) + "\n").encode()
    with atomic_folder(target, marker=MARKER) as work:
        for name, data in content.items():
            (work / name).write_bytes(data)
    return [target / name for name in content if name != MARKER]


def check_figures_target(target: Path, report: Path) -> None:
    """Refuse a place for figures before any work is spent on them.

    Args:
        target: where they are to go; a folder within the report is one of its own.
        report: where the report goes.

    Raises:
        OutputError: `target` is somebody else's, or cannot be written.
        UsageError: the report would be in it, and be replaced by it.
    """
    if target.resolve() in (report.resolve(), *report.resolve().parents):
        raise UsageError(
            "figures need a folder of their own", where=target, hint=f"as {report / 'figures'}"
        )
    check_target(target, MARKER, "--figures")


def _files(post: Postmortem, panel: Panel) -> dict[str, bytes] | None:
    with canvas.plain_style():
        figure = panel.figure(post, panel.width_in)
        if figure is None:
            return None
        told = caption(panel, post)
        return {
            f"{panel.name}.png": captioned_png(figure, panel.title, told),
            f"{panel.name}.svg": captioned_svg(figure, panel.title, told),
        }


def _captions(listed: list[dict[str, object]]) -> str:
    """A heading and a paragraph for each figure; what a log wrote is no markup."""
    told = [f"## {x['name']}: {x['title']}\n\n{as_markdown(str(x['caption']))}\n" for x in listed]
    return "\n".join(["# Captions\n", *told])
