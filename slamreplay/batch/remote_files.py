"""Files behind addresses: which there are, and what tells that one has changed."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

from slamreplay.batch.addresses import is_web, scheme_of, shown
from slamreplay.batch.stores import file_system, store_error
from slamreplay.errors import LogError

#: A site that has more pages, or deeper ones, makes them up.
_MAX_PAGES, _MAX_DEPTH = 10_000, 15
#: Questions asked at once.
_AT_ONCE = 16
_VERSIONS = ("ETag", "etag", "generation", "md5Hash", "Content-MD5", "Digest", "Last-Modified",
             "LastModified", "last_modified", "mtime", "updated", "modified")  # fmt: skip


@dataclass(frozen=True)
class RemoteFile:
    """A file.

    Attributes:
        url: with all that it takes to get it.
        size: B, None where nobody said.
        version: empty where nobody said.
    """

    url: str
    size: int | None
    version: str


def remote_file(url: str, storage: Mapping[str, object]) -> RemoteFile | None:
    """What an address names, None where it is a folder or an index page.

    Raises:
        StoreError: it does not exist, or cannot be asked.
    """
    if url.endswith("/"):
        return None
    store = file_system(url, storage)
    try:
        about = store.info(url)
    except Exception as error:
        raise store_error(error, url, storage) from error
    if about.get("type") == "directory" or about.get("mimetype") == "text/html":
        return None
    return _described(url, about)


def remote_files(urls: Iterable[str], storage: Mapping[str, object]) -> list[RemoteFile]:
    """The same of many files that are known to be there, asked for a few at once."""

    def one(url: str) -> RemoteFile:
        return remote_file(url, storage) or RemoteFile(url, None, "")

    with ThreadPoolExecutor(_AT_ONCE) as pool:
        return list(pool.map(one, urls))


def remote_below(
    root: str,
    storage: Mapping[str, object],
    *,
    prefix: str = "",
    reaches: Callable[[str], bool] = lambda _url: True,
    skipped: Callable[[str], None] = lambda _why: None,
) -> list[RemoteFile]:
    """All files below a folder of a store or an index page of a web server.

    Args:
        root: the folder's address, with a slash at its end.
        storage: options of fsspec.
        prefix: only names in it that begin so, where a store can look for them.
        reaches: told a page's address, whether to look into it.
        skipped: told a reason for each page that could not be read.

    Raises:
        StoreError: the root cannot be read.
    """
    store = file_system(root, storage)
    try:
        if is_web(root):
            return _by_pages(store, root, reaches, skipped)
        more = (
            {"prefix": prefix} if prefix and scheme_of(root) in ("s3", "s3a", "gs", "gcs") else {}
        )
        found: dict[str, Any] = store.find(root.rstrip("/"), detail=True, **more)
    except LogError:
        raise
    except Exception as error:
        raise store_error(error, root, storage) from error
    scheme = scheme_of(root)
    files = {n: a for n, a in found.items() if a.get("type") == "file"}
    return [_described(n if scheme_of(n) else f"{scheme}://{n}", a) for n, a in files.items()]


def _by_pages(
    store: Any, root: str, reaches: Callable[[str], bool], skipped: Callable[[str], None]
) -> list[RemoteFile]:
    """Over the links of pages to the pages below them; sizes are asked for later."""
    pages, seen = [root], {root}
    files: set[str] = set()
    while pages:
        page = pages.pop()
        try:
            links = store.ls(page, detail=True)
        except Exception:
            if page == root:
                raise
            skipped("index pages that cannot be read")
            continue
        for link in links:
            url = link["name"]
            if not url.endswith("/"):
                files.add(url)
            elif url not in seen and reaches(shown(url)):
                too_many = len(seen) >= _MAX_PAGES or url.count("/") > root.count("/") + _MAX_DEPTH
                if too_many:
                    skipped(f"index pages beyond {_MAX_PAGES} or {_MAX_DEPTH} deep")
                    continue
                seen.add(url)
                pages.append(url)
    return [RemoteFile(url, None, "") for url in sorted(files)]


def _described(url: str, about: Mapping[str, Any]) -> RemoteFile:
    size = about.get("size")
    version = next((str(about[name]) for name in _VERSIONS if about.get(name)), "")
    return RemoteFile(url, None if size is None else int(size), version.strip('"'))
