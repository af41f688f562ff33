"""The cache on disk: what is damaged, or could be somebody else's, is made again."""

import hashlib
import os

import pytest

from accelstudy.files.cache import cache_folder, cached


@pytest.fixture(autouse=True)
def caches(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "caches"))


def value():
    return cached("planted", "key", lambda: b"true", bytes.decode)


def stored(content):
    return hashlib.sha256(content).digest() + content


def linked(path):
    """Put a link to a file or folder in its place."""
    elsewhere = path.parents[2] / "x"
    path.rename(elsewhere)
    path.symlink_to(elsewhere)


DAMAGED = {
    "a bit": lambda content: content[:-1] + bytes([content[-1] ^ 1]),
    "the end": lambda content: content[:-2],
    "all": lambda content: b"",
    "not to be loaded": lambda content: stored(b"\xff"),
}
OTHERS = {
    "file": lambda file, patch: file.chmod(0o620),
    "folder": lambda file, patch: file.parent.chmod(0o702),
    "link": lambda file, patch: linked(file),
    "link of a folder": lambda file, patch: linked(file.parent),
    "fifo": lambda file, patch: (file.unlink(), os.mkfifo(file)),
    "folder as a file": lambda file, patch: (file.unlink(), file.mkdir()),
    "another user": lambda file, patch: patch.setattr(os, "geteuid", lambda: os.getuid() + 1),
}
"""What somebody else can have written."""


@pytest.mark.parametrize("wrong", [*DAMAGED, *OTHERS])
def test_what_is_damaged_or_can_be_somebody_elses_is_not_there(wrong, monkeypatch):
    """What is planted is whole: only whose it is, and who can write it, tells it apart."""
    assert value() == "true"
    folder = cache_folder("planted")
    assert folder.stat().st_mode & 0o777 == 0o700
    (file,) = folder.iterdir()
    file.write_bytes(stored(b"false"))
    assert value() == "false"  # it is the user's own
    if wrong in OTHERS:
        OTHERS[wrong](file, monkeypatch)
        assert value() == "true"
        return
    file.write_bytes(DAMAGED[wrong](file.read_bytes()))
    assert value() == "true"
    assert [path.read_bytes() for path in folder.iterdir()] == [stored(b"true")]


def test_where_nothing_can_be_stored_it_is_made_each_time(tmp_path):
    (tmp_path / "caches").write_text("no folder", encoding="utf-8")
    assert value() == value() == "true"
