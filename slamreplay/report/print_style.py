"""What stands in the margins of printed pages: the log's name, and the number of the page."""

from __future__ import annotations

import re

from slamreplay.evidence.clean import clean

#: Letters of a name that fit into the margin.
_MOST = 80
_PLAIN = re.compile(r"[^A-Za-z0-9_.+ -]")


def print_style(title: str, kind: str = "slamreplay post-mortem") -> str:
    """A style sheet of its own, for the name is the log's; `kind` of page stands at the left."""
    shown = title if len(title) <= _MOST else f"{title[: _MOST - 3]}..."
    return (
        "@page{"
        f'@top-left{{content:"{kind}";font:8pt sans-serif;color:#555b61}}'
        f'@top-right{{content:"{_escaped(clean(shown))}";font:8pt sans-serif;color:#555b61}}'
        '@bottom-right{content:counter(page) " of " counter(pages);'
        "font:8pt sans-serif;color:#555b61}}"
        "@page:first{@top-left{content:none}@top-right{content:none}}"
    )


def _escaped(text: str) -> str:
    """As CSS strings have it (CSS Syntax 3, section 4.3.7): code points in hexadecimal digits."""
    return _PLAIN.sub(lambda found: f"\\{ord(found[0]):x} ", text)
