"""Compiled kernels find a place where the package's own folder cannot be written to."""

import os
import tempfile

import pytest

from slamreplay.caches import cache_folder
from slamreplay.kernel_cache import VARIABLE, keep_kernels


@pytest.fixture(autouse=True)
def unset(monkeypatch):
    monkeypatch.setenv(VARIABLE, "")
    monkeypatch.delenv(VARIABLE)


@pytest.fixture
def read_only(monkeypatch, tmp_path):
    """Only folders under `tmp_path` may be written to, and temporary ones are made there."""
    monkeypatch.setattr(os, "access", lambda path, mode: path.is_relative_to(tmp_path))
    monkeypatch.setattr(tempfile, "gettempdir", lambda: str(tmp_path / "tmp"))


def test_a_package_that_can_be_written_to_keeps_them_itself(tmp_path):
    keep_kernels(tmp_path / "caches")

    assert VARIABLE not in os.environ
    assert not (tmp_path / "caches").exists()


def test_they_go_to_the_program_s_own_caches(tmp_path, read_only):
    keep_kernels(tmp_path / "caches")

    assert os.environ[VARIABLE] == str(tmp_path / "caches" / "numba")


def test_without_a_cache_folder_they_go_to_the_temporary_one(tmp_path, read_only):
    (tmp_path / "caches").write_text("a file stands in the way")

    keep_kernels(tmp_path / "caches")

    assert os.environ[VARIABLE] == str(tmp_path / "tmp" / f"slamreplay-{os.getuid()}" / "numba")


def test_a_folder_others_may_write_to_is_not_trusted(tmp_path, read_only):
    (tmp_path / "caches").write_text("a file stands in the way")
    shared = tmp_path / "tmp" / f"slamreplay-{os.getuid()}"
    shared.mkdir(parents=True)
    shared.chmod(0o777)

    keep_kernels(tmp_path / "caches")

    assert VARIABLE not in os.environ


def test_what_the_user_says_holds(tmp_path, read_only, monkeypatch):
    monkeypatch.setenv(VARIABLE, "elsewhere")

    keep_kernels(tmp_path / "caches")

    assert os.environ[VARIABLE] == "elsewhere"


def test_a_user_without_a_home_has_a_cache_folder(monkeypatch):
    def nobody():
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr("pathlib.Path.home", nobody)

    assert cache_folder().parent.samefile(tempfile.gettempdir())
