"""Stores that fsspec reaches: how one is opened, and what its errors mean in one line."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from slamreplay.batch.addresses import WEB, scheme_of, shown, without_secrets
from slamreplay.errors import LogError, UsageError

#: How long a host may take to answer at all, and to give the next bytes, s.
CONNECT_S, READ_S = 5, 60
_EXTRAS = {"s3": "s3", "s3a": "s3", "http": "http", "https": "http"}
_PACKAGES = {"gs": "gcsfs", "gcs": "gcsfs", "az": "adlfs", "abfs": "adlfs", "abfss": "adlfs"}
_SILENT = {
    "EndpointConnectionError", "ConnectTimeoutError", "ReadTimeoutError", "ConnectionClosedError",
    "ClientConnectionError", "ServerTimeoutError", "gaierror", "ConnectionError", "TimeoutError",
    "ClientPayloadError", "IncompleteRead", "IncompleteReadError",
}  # fmt: skip
_NO_CREDENTIALS = {
    "NoCredentialsError", "PartialCredentialsError", "ProfileNotFound", "DefaultCredentialsError",
    "TokenRetrievalError", "UnauthorizedSSOTokenError", "SSOTokenLoadError",
}  # fmt: skip
_HOW_TO_GET_IN = (
    "credentials come from the store's own environment variables and profiles, or --storage"
)


class StoreError(LogError):
    """What a store answered, or that it did not.

    Attributes:
        is_passing: another try may go better.
        is_missing: the store knows no such thing.
    """

    is_passing = False
    is_missing = False


def storage_options(given: Sequence[str]) -> dict[str, object]:
    """The options of `--storage KEY=VALUE`, each of which fsspec's file system of the store knows.

    A dot leads into an option that holds others (`client_kwargs.region_name=eu-west-1`); a scheme
    before a colon keeps one from other stores (`s3:endpoint_url=http://minio:9000`). Values are
    true, false, whole numbers or else texts.

    Raises:
        UsageError: no KEY=VALUE; the value, which may be a secret, is not in it.
    """
    found: dict[str, object] = {}
    for text in given:
        key, equals, value = text.partition("=")
        names = key.strip().split(".")
        if not equals or not all(names):
            raise UsageError("--storage takes KEY=VALUE", hint="as in --storage anon=true")
        inner = found
        for name in names[:-1]:
            deeper = inner.setdefault(name, {})
            if not isinstance(deeper, dict):
                raise UsageError(f"--storage has '{name}' as a value and as more than one")
            inner = deeper
        words: dict[str, object] = {"true": True, "false": False}
        number = int(value) if value.isdecimal() and len(value) < 10 else value
        inner[names[-1]] = words.get(value.lower(), number)
    return found


def options_of(scheme: str, storage: Mapping[str, object]) -> dict[str, Any]:
    """Those that are for a store: all without a scheme, and its own."""
    found: dict[str, Any] = {}
    for key, value in storage.items():
        of, colon, name = key.partition(":")
        if not colon:
            found.setdefault(key, value)
        elif of == scheme or (of, scheme) in (WEB, ("s3", "s3a")):
            found[name] = value
    return found


def file_system(place: str, storage: Mapping[str, object]) -> Any:
    """Fsspec's file system of an address, with short times to wait.

    Raises:
        StoreError: the package that reaches it is not installed, or it takes no such options.
        UsageError: fsspec knows no such scheme.
    """
    import fsspec

    scheme = scheme_of(place)
    if "::" in place or scheme not in fsspec.available_protocols():
        kind = "::" if "::" in place else scheme
        raise UsageError(f"there is no kind of address '{kind}'", where=shown(place),
                         hint="a path, file://, s3://, https://, gs:// or az://")  # fmt: skip
    try:
        return fsspec.filesystem(scheme, **_patience(scheme), **_merged(scheme, storage))
    except Exception as error:
        raise store_error(error, place, storage) from error


def _merged(scheme: str, storage: Mapping[str, object]) -> dict[str, Any]:
    options: dict[str, Any] = {"use_listings_cache": False, **options_of(scheme, storage)}
    if scheme in ("s3", "s3a"):
        quick = {"connect_timeout": CONNECT_S, "read_timeout": READ_S,
                 "retries": {"max_attempts": 1}}  # fmt: skip
        options["config_kwargs"] = {**quick, **options.get("config_kwargs", {})}
    return options


def _patience(scheme: str) -> dict[str, Any]:
    if scheme not in WEB:
        return {}
    import aiohttp

    return {
        "client_kwargs": {
            "timeout": aiohttp.ClientTimeout(total=None, sock_connect=CONNECT_S, sock_read=READ_S)
        }
    }


def store_error(error: BaseException, place: str, storage: Mapping[str, object]) -> StoreError:
    """What went wrong at an address, in one line without anything that lets somebody in."""
    where, scheme = shown(place), scheme_of(place)
    chain = list(_chain(error))
    kinds = {kind.__name__ for e in chain for kind in type(e).__mro__}
    status = next((e.status for e in chain if hasattr(e, "status")), None)  # of aiohttp
    host = where.split("://")[-1].partition("/")[0]
    if "ImportError" in kinds:
        return StoreError(f"what reads {scheme}:// is not installed", where=where,
                          hint=_install(scheme))  # fmt: skip
    if kinds & _NO_CREDENTIALS:
        return StoreError("there are no credentials for it", where=where, hint=_HOW_TO_GET_IN)
    if "PermissionError" in kinds or status in (401, 403):
        return StoreError("access denied", where=where, hint=_HOW_TO_GET_IN)
    full = next((e for e in chain if isinstance(e, OSError) and e.errno == errno.ENOSPC), None)
    if full is not None:
        return StoreError("no room to copy it to", where=where, hint="set TMPDIR to a larger disk")
    if status is not None and status != 404:
        return _passing(f"the server answers {status}", where)
    if kinds & _SILENT:
        return _passing(f"{host} does not answer", where)
    if "FileNotFoundError" in kinds or status == 404:
        missing = StoreError("no such file, folder or bucket", where=where)
        missing.is_missing = True
        return missing
    text = without_secrets(str(error), _secrets(storage))[:200]
    return _passing(f"cannot read: {text or type(error).__name__}", where)


def _passing(what: str, where: str) -> StoreError:
    found = StoreError(what, where=where)
    found.is_passing = True
    return found


def _install(scheme: str) -> str:
    if scheme in _EXTRAS:
        return f"pip install 'slamreplay[{_EXTRAS[scheme]}]'"
    return f"pip install {_PACKAGES.get(scheme, f'the package of fsspec for {scheme}')}"


def _chain(error: BaseException | None) -> Iterator[BaseException]:
    seen: set[int] = set()
    while error is not None and id(error) not in seen:
        seen.add(id(error))
        yield error
        error = error.__cause__ or error.__context__


def _secrets(storage: Mapping[str, object]) -> Iterator[object]:
    for value in storage.values():
        if isinstance(value, Mapping):
            yield from _secrets(value)
        elif isinstance(value, str) and not value.startswith(("http://", "https://")):
            yield value
    for name in ("AWS_SECRET_ACCESS_KEY", "AWS_SESSION_TOKEN"):
        yield os.environ.get(name, "")
