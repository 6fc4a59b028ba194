"""Whether a log is all there, wherever it lies."""

from __future__ import annotations

from slamreplay.batch.addresses import scheme_of
from slamreplay.batch.complete import Completeness, is_complete
from slamreplay.batch.fetch import local_log
from slamreplay.batch.grouping import METADATA, is_storage_name
from slamreplay.batch.task import LogSource

#: Stores in which a file is there as a whole or not at all.
_OBJECT_STORES = frozenset({"s3", "s3a", "gs", "gcs", "az", "abfs", "abfss", "adl", "oci"})


def completeness(source: LogSource) -> Completeness:
    """What a log says of itself: on this machine by its bytes, elsewhere by what there is of it."""
    path = local_log(source)
    if path is not None:
        return is_complete(path)
    names = {file.name.rpartition("/")[2] for file in source.files}
    if source.folder and METADATA not in names and any(map(is_storage_name, names)):
        return Completeness("no", f"there is no {METADATA} yet")
    if scheme_of(source.files[0].url) in _OBJECT_STORES:
        return Completeness("yes", "a store has whole files only")
    return Completeness("unknown", "its bytes are elsewhere")
