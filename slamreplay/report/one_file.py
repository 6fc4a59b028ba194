"""A page that is one file: no network, and nothing is applied or run but what it came with."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Mapping, Sequence
from importlib.resources import files

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined

from slamreplay.evidence.clean import clean, straight
from slamreplay.report.phrases import bound

_PACKAGE = "slamreplay.report"


def render(
    template: str,
    values: Mapping[str, object],
    *,
    styles: Sequence[str],
    scripts: Sequence[str],
    package: str = _PACKAGE,
) -> str:
    """The text of a page. Whatever came from a log is escaped by the template engine.

    Args:
        template: its name; it prints `policy`, `styles` and `scripts` as they are.
        values: what else it prints.
        styles: style sheets, each to stand in an element of its own.
        scripts: modules, likewise.
        package: whose `templates` are looked through before the report's own.
    """
    environment = Environment(
        loader=ChoiceLoader([PackageLoader(name) for name in dict.fromkeys((package, _PACKAGE))]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["bound"] = bound
    text = environment.get_template(template).render(
        policy=_policy(styles, scripts), styles=styles, scripts=scripts, **values
    )
    return straight(clean(text))


def texts(names: Sequence[str], package: str = _PACKAGE) -> list[str]:
    """What files of a package's `templates` hold."""
    folder = files(package).joinpath("templates")
    return [folder.joinpath(name).read_text("utf-8") for name in names]


def _policy(styles: Sequence[str], scripts: Sequence[str]) -> str:
    """Hashes, not 'unsafe-inline': the page's own styles and scripts are all that is applied."""
    return "; ".join([
        "default-src 'none'",
        "img-src data:",
        " ".join(["style-src", *map(_hash, styles)]),
        *([" ".join(["script-src", *map(_hash, scripts)])] if scripts else []),
        "base-uri 'none'",
        "form-action 'none'",
    ])  # fmt: skip


def _hash(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"
