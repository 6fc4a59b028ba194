"""What many tests need: where the real logs are."""

import os
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="session")
def real_logs() -> Path:
    """Folder of real logs, or a skip that says where they were looked for."""
    named = os.environ.get("SLAMREPLAY_REAL_LOGS")
    folder = Path(named) if named else ROOT.parent / "shared" / "logs"
    if not folder.is_dir():
        pytest.skip(f"no real logs at {folder} (set SLAMREPLAY_REAL_LOGS)")
    return folder
