"""What the fleet's page needs of a batch's folder, and what it leaves there."""

from __future__ import annotations

MAPS, PAGE_FILE, QUERIES_FILE = "maps", "fleet.html", "queries.sql"


def map_folder(version: str) -> str:
    """Where a map is, from the batch's folder."""
    return f"{MAPS}/{version.removeprefix('sha256:')[:16]}"
