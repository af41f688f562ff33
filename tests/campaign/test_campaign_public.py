"""Public measurements: a file is got whole or not at all."""

import hashlib

import pytest
from calling import refused

from accelstudy.campaign.importing import public
from accelstudy.campaign.importing.public import PublicData, public_file

CONTENT = bytes(range(256)) * 64


def data(url, content=CONTENT):
    return PublicData(
        description="a file", url=url, sha256=hashlib.sha256(content).hexdigest(), licence="MIT"
    )


@pytest.fixture
def fetch(tmp_path, monkeypatch):
    """Function that gets a file into a folder."""

    def get(known):
        monkeypatch.setattr(public, "public_data", lambda: {"name": known})
        return public_file("name", tmp_path)

    return get


def test_a_file_that_is_there_is_not_downloaded(tmp_path, fetch):
    (tmp_path / "a" / "b").mkdir(parents=True)
    (tmp_path / "a" / "file.log").write_bytes(b"another file of that name")
    (tmp_path / "a" / "b" / "file.log").write_bytes(CONTENT)
    missing = data("https://nowhere.invalid/at%20all/file.log")
    assert fetch(missing) == tmp_path / "a" / "b" / "file.log"


def test_a_file_that_is_missing_is_downloaded_once(tmp_path, fetch, monkeypatch):
    def retrieve(url, checksum, name, folder, downloader):
        assert checksum == f"sha256:{hashlib.sha256(CONTENT).hexdigest()}"
        folder.mkdir()
        (folder / name).write_bytes(CONTENT)

    monkeypatch.setattr("pooch.retrieve", retrieve)
    path = fetch(data("https://nowhere.invalid/a%20folder/file.log"))
    assert path == tmp_path / "name" / "file.log"
    monkeypatch.setattr("pooch.retrieve", None)
    assert fetch(data("https://nowhere.invalid/file.log")) == path


@pytest.mark.parametrize(("failure", "message"), [
    (ValueError("SHA256 hash does not match"), "has another sha256"),
    (OSError("404 Not Found"), "cannot be downloaded: 404"),
    (OSError("no route\nto host"), "put the file file.log below"),
])  # fmt: skip
def test_what_fails_is_one_line(fetch, monkeypatch, failure, message):
    def retrieve(*_, **how):
        raise failure

    monkeypatch.setattr("pooch.retrieve", retrieve)
    with refused(message, "try again"):
        fetch(data("https://nowhere.invalid/file.log"))
