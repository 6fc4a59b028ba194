"""Addresses of logs, and how they are shown: never with what lets somebody in."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from pathlib import Path
from urllib.parse import unquote

_SCHEME = re.compile(r"([a-z][a-z0-9+.-]*)://", re.IGNORECASE)
#: What may stand within a sentence of a library: an address, up to a blank or a quote.
_ANY_ADDRESS = re.compile(r"[a-z][a-z0-9+.-]*://[^\s'\"<>]+", re.IGNORECASE)
_SHORTEST_SECRET = 4
#: Schemes of the web: an address there may end with a query, and folders are pages.
WEB = ("http", "https")
#: Azure writes container@account where others have a user.
_CONTAINER_AT_HOST = ("abfs", "abfss")
#: By whether it is an address of the web: names in a bucket may hold a ? or a #.
_QUERY = {True: re.compile(r"[?#].*", re.DOTALL), False: re.compile(r"\?[^/?=]*=.*", re.DOTALL)}


def scheme_of(place: str) -> str:
    """`s3` of s3://bucket/key, empty of a path."""
    found = _SCHEME.match(place)
    return found[1].lower() if found else ""


def is_local(url: str) -> bool:
    """Whether it is a path on this machine, as LogFile has it."""
    return not scheme_of(url)


def is_remote(place: str) -> bool:
    """Whether it is an address that is not on this machine: no path and no `file://`."""
    return scheme_of(place) not in ("", "file")


def is_web(place: str) -> bool:
    """Whether it is an address of the web."""
    return scheme_of(place) in WEB


def local_path(place: str) -> str:
    """The path that `file://` addresses and paths name, as it is given."""
    if scheme_of(place) != "file":
        return place
    return "/" + unquote(place.split("://", 1)[1].partition("/")[2])


def shown(place: str) -> str:
    """A path or address for people: no user, password, query or fragment, one printable line.

    A signed query is a password, and which query is one cannot be told; so none is shown.
    """
    scheme = scheme_of(place)
    if scheme:
        host, slash, path = place.split("://", 1)[1].partition("/")
        if scheme not in _CONTAINER_AT_HOST:
            host = host.rpartition("@")[2]
        place = f"{scheme}://" + _QUERY[scheme in WEB].sub("", host + slash + path)
    return printable(place)


def printable(text: str) -> str:
    r"""The text with what is no UTF-8 or cannot be printed as \xNN: a name may hold any byte."""
    text = text.encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def without_secrets(text: str, secrets: Iterable[object] = ()) -> str:
    """A library's sentence on one line, its addresses as `shown` has them.

    Args:
        text: of an error.
        secrets: values that must not be in it, such as keys from --storage.
    """
    text = _ANY_ADDRESS.sub(lambda found: shown(found[0]), text)
    for secret in sorted((str(s) for s in secrets), key=len, reverse=True):
        if len(secret) >= _SHORTEST_SECRET:
            text = text.replace(secret, "***")
    return " ".join(printable(line) for line in text.split())


def name_of(place: str) -> str:
    """The last part of a path or address, without its query."""
    if is_web(place):
        path = place.split("://", 1)[1].partition("/")[2]
        return unquote(_QUERY[True].sub("", path).rstrip("/").rpartition("/")[2])
    return place.rstrip("/").rpartition("/")[2]


def absolute(path: str) -> str:
    """An absolute path; links in it stay, for they are the name the user knows."""
    return Path(os.path.abspath(path)).as_posix()  # noqa: PTH100 - pathlib keeps `..`


def beside(table: str, given: str | None) -> str | None:
    """What a file at `table` names: a path relative to it, or one that stands for itself."""
    if given is None or scheme_of(given) or given.startswith("/"):
        return given
    if is_remote(table):
        return f"{table.partition('?')[0].rpartition('/')[0]}/{given}"
    return os.path.join(os.path.dirname(local_path(table)), given)  # noqa: PTH118, PTH120
