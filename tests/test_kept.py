"""What was worked out before is found by all that it depends on, and damage is worked out again."""

import numpy as np
import pytest

from slamreplay.bundle import kept as module
from slamreplay.bundle.code_hash import code_hash
from slamreplay.bundle.kept import kept


@pytest.fixture
def made():
    return []


def asked(folder, made, *told):
    return kept(folder, told, lambda: made.append(told) or f"{told}".encode())


def test_the_same_texts_are_worked_out_once_and_others_anew(tmp_path, made):
    found = [asked(tmp_path / "k", made, *t) for t in (("a", "b"), ("a", "b"), ("ab",), ("a",))]

    assert found == [b"('a', 'b')", b"('a', 'b')", b"('ab',)", b"('a',)"]
    assert made == [("a", "b"), ("ab",), ("a",)]


def test_another_program_works_it_out_anew(tmp_path, made, monkeypatch):
    asked(tmp_path, made, "a")
    monkeypatch.setattr(module, "code_hash", lambda: "another")
    asked(tmp_path, made, "a")
    monkeypatch.setattr(np, "__version__", "another")
    asked(tmp_path, made, "a")

    assert len(made) == 3
    assert len({code_hash(), code_hash("geometry"), code_hash("geometry", "maps")}) == 3


@pytest.mark.parametrize("left", [b"", b"short", b"('b',)" + 32 * b"0"])
def test_what_is_damaged_is_replaced(tmp_path, made, left):
    asked(tmp_path, made, "a")
    (file,) = tmp_path.iterdir()
    file.write_bytes(left)

    assert [asked(tmp_path, made, "a") for _ in range(2)] == [b"('a',)"] * 2
    assert len(made) == 2


def test_a_folder_that_cannot_be_written_and_none_keep_nothing(tmp_path, made):
    (tmp_path / "file").write_text("no folder")

    assert [asked(f, made, "a") for f in (tmp_path / "file", None)] == [b"('a',)"] * 2
    assert len(made) == 2
