"""Patterns of addresses: shell wildcards, and places with a name whose text becomes a label.

`*` is any text within a part, `?` one character, `[abc]` and `[!abc]` one of or none of them,
`**` as a whole part any number of parts, `{name}` at least one character within a part. Where
several readings fit, the earlier place takes as little as it can.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

from slamreplay.batch.addresses import is_web, scheme_of
from slamreplay.errors import UsageError

#: More is no pattern that somebody wrote.
MAX_LENGTH, MAX_ANY_DEPTH = 1000, 4
_NAME = re.compile(r"[a-z][a-z0-9_]{0,39}")
_TOKEN = re.compile(r"\*+|\?|\[!?\]?[^\]/]*\]|\{[^{}/]*\}|\{|\}")
_WILDCARD = re.compile(r"[*?\[]")
_PLACE = re.compile(r"\{([^{}/]*)\}")


@dataclass(frozen=True)
class Pattern:
    """A pattern that is known to be one.

    Attributes:
        text: as it was given.
        parts: a regular expression for each part between slashes, None for `**`.
    """

    text: str
    parts: tuple[re.Pattern[str] | None, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Of its named places, in order."""
        return tuple(name for part in self.parts if part for name in part.groupindex)

    def match(self, address: str) -> dict[str, str] | None:
        """The text of each named place where it fits all of an address, None where it does not."""
        return self._match(0, address.split("/"), 0)

    def reaches(self, folder: Sequence[str]) -> bool:
        """Whether what fits may lie in a folder or above it, given by its parts."""
        for part, expression in zip(folder, self.parts, strict=False):
            if expression is None:
                return True
            if not expression.fullmatch(part):
                return False
        return True

    def _match(self, i: int, given: list[str], k: int) -> dict[str, str] | None:
        """The rest of the parts, from the i-th of the pattern and the k-th of the address."""
        found: dict[str, str] = {}
        while i < len(self.parts):
            expression = self.parts[i]
            if expression is None:
                ends = (self._match(i + 1, given, at) for at in range(k, len(given) + 1))
                rest = next((end for end in ends if end is not None), None)
                return None if rest is None else {**found, **rest}
            fits = expression.fullmatch(given[k]) if k < len(given) else None
            if fits is None:
                return None
            found |= fits.groupdict()
            i, k = i + 1, k + 1
        return found if k == len(given) else None


def is_pattern(text: str) -> bool:
    """Whether a path or address holds wildcards; a `?` of http begins its query."""
    if is_web(text):
        text = text.replace("?", "")
    return bool(_WILDCARD.search(text))


def fixed_text(text: str) -> str:
    """What stands before the first wildcard."""
    found = _WILDCARD.search(text)
    return text[: found.start()] if found else text


def fixed_folder(text: str) -> str:
    """The folder before the first part that holds a wildcard, with its slash; empty if none."""
    fixed = fixed_text(text)
    return fixed[: fixed.rfind("/") + 1]


@lru_cache(maxsize=1024)
def pattern_of(text: str, *, anywhere: bool = False) -> Pattern:
    """The pattern of a text.

    Args:
        text: with `/` between parts.
        anywhere: one without `/` or a scheme before it fits the last parts of an address.

    Raises:
        UsageError: it is none; without its place, which the caller knows.
    """
    if not text or len(text) > MAX_LENGTH:
        why = "is empty" if not text else f"is longer than {MAX_LENGTH} characters"
        raise UsageError(f"a pattern {why}", hint="as in logs/{site}/{robot}/*.mcap")
    fixed = text.startswith("/") or bool(scheme_of(text))
    given = text.removesuffix("/").split("/")
    while given[:1] == ["."]:
        given = given[1:]
    parts = tuple(None if part == "**" else _part(part, text) for part in given)
    if anywhere and not fixed:
        parts = (None, *parts)
    squeezed = tuple(p for i, p in enumerate(parts) if p or not i or parts[i - 1])
    if sum(part is None for part in squeezed) > MAX_ANY_DEPTH:
        raise UsageError(f"the pattern '{text}' has too many **",
                         hint="one stands for any number of parts")  # fmt: skip
    found = Pattern(text, squeezed)
    if len(set(found.names)) < len(found.names):
        twice = next(n for n in found.names if found.names.count(n) > 1)
        raise UsageError(f"the pattern '{text}' has {{{twice}}} twice",
                         hint="put * for the second one")  # fmt: skip
    return found


def _part(part: str, text: str) -> re.Pattern[str]:
    """One part. All wildcards but the last take the least that lets the text after them follow.

    That is as good as any other choice, and once made it is kept (an atomic group): a match takes
    no longer than the part's length squared, whatever somebody wrote.
    """
    places: list[str] = []
    fixed = [""]
    at = 0
    for token in _TOKEN.finditer(part):
        fixed[-1] += re.escape(part[at : token.start()])
        at = token.end()
        found = token[0]
        if found.startswith("*"):
            places.append("[^/]*?")
            fixed.append("")
        elif found == "?":
            fixed[-1] += "[^/]"
        elif found.startswith("["):
            fixed[-1] += _choice(found, text)
        else:
            name = found[1:-1]
            if len(found) < 3 or not _NAME.fullmatch(name):
                raise UsageError(
                    f"the pattern '{text}' has a '{found[:40]}'",
                    hint="a name is of small letters, digits and _, as in {site}",
                )
            places.append(f"(?P<{name}>[^/]+?)")
            fixed.append("")
    fixed[-1] += re.escape(part[at:])
    inner = "".join(f"(?>{w}{f})" for w, f in zip(places[:-1], fixed[1:-1], strict=True))
    return re.compile(fixed[0] + inner + (places[-1] + fixed[-1] if places else ""), re.DOTALL)


def _choice(token: str, text: str) -> str:
    inside = token[1:-1]
    sign = "^" if inside.startswith("!") else ""
    body = inside.removeprefix("!")
    body = body.replace("\\", r"\\").replace("^", r"\^").replace("[", r"\[").replace("]", r"\]")
    body = body.replace("&", r"\&").replace("~", r"\~").replace("|", r"\|")
    try:
        return re.compile(f"[{sign}{body}]").pattern
    except re.error as error:
        raise UsageError(
            f"the pattern '{text}' has a '{token[:40]}'", hint="as in [0-9]"
        ) from error


def filled(text: str, labels: dict[str, str]) -> str:
    """The text with `{name}` replaced by the label of that name.

    Raises:
        UsageError: there is no such label; without its place.
    """

    def value(found: re.Match[str]) -> str:
        if found[1] not in labels:
            raise UsageError(f"'{text}' names {found[0]}, the pattern does not")
        return labels[found[1]]

    return _PLACE.sub(value, text)
