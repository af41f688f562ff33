"""Public measurements: the registry knows the files, and a file is got whole or not at all."""

import gc
import hashlib
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest
from calling import refused, succeed
from places import DATA, needs_data

from accelstudy.campaign.format import read_campaign
from accelstudy.campaign.importing import public
from accelstudy.campaign.importing.public import (
    PublicData,
    public_data,
    public_file,
)

CONTENT = bytes(range(256)) * 64


def data(url, content=CONTENT):
    return PublicData(
        description="a file", url=url, sha256=hashlib.sha256(content).hexdigest(), licence="MIT"
    )


class Server(BaseHTTPRequestHandler):
    """Serves CONTENT; /missing has nothing, and /broken only half of it."""

    def do_GET(self):
        if self.path.startswith("/missing"):
            return self.send_error(404)
        self.send_response(200)
        self.send_header("Content-Length", str(len(CONTENT)))
        self.end_headers()
        self.server.asked += 1
        half = self.path.startswith("/broken")
        self.wfile.write(CONTENT[: len(CONTENT) // 2] if half else CONTENT)

    def log_message(self, *arguments):
        pass


@pytest.fixture
def server(monkeypatch):
    monkeypatch.setenv("no_proxy", "127.0.0.1")
    with ThreadingHTTPServer(("127.0.0.1", 0), Server) as running:
        running.asked = 0
        running.url = f"http://127.0.0.1:{running.server_port}"
        thread = threading.Thread(target=running.serve_forever, args=(0.01,))
        thread.start()
        yield running
        running.shutdown()
        thread.join()
    gc.collect()  # a connection left open warns here, not in a test that comes later


@pytest.fixture
def fetch(tmp_path, monkeypatch):
    """Function that gets a file into a folder."""

    def get(known):
        monkeypatch.setattr(public, "public_data", lambda: {"name": known})
        return public_file("name", tmp_path)

    return get


def left(folder):
    """Files below a folder."""
    return sorted(path.name for path in folder.rglob("*") if path.is_file())


@pytest.mark.parametrize("name", public_data())
def test_the_registry_says_how_a_file_is_read(name):
    known = public_data()[name]
    assert known.url.startswith("https://raw.githubusercontent.com/")
    assert known.licence in ("MIT", "BSD-2-Clause", "Apache-2.0")
    settings = known.settings
    if settings is not None:
        assert {*settings.columns} == {"fx", "fy", "fz"}
        assert (settings.scale is not None) == (settings.unit == "counts")
        timed = settings.rate_hz is not None or settings.time is not None
        assert settings.means or settings.block is not None or timed


def test_command_lists():
    result = succeed("public")
    for name, entry in public_data().items():
        assert f"{name}: {entry.description}\n    {entry.licence}, {entry.url}\n" in result.output


@needs_data
def test_command(tmp_path):
    result = succeed("public", "mpu6050", "--out", tmp_path / "out", "--folder", DATA)
    assert "holds: 10" in result.output
    assert read_campaign(tmp_path / "out").sensor == "MPU-6050"
    assert (tmp_path / "out" / "segmentation.png").exists()


def test_a_file_that_is_there_is_not_downloaded(tmp_path, fetch):
    (tmp_path / "a" / "b").mkdir(parents=True)
    (tmp_path / "a" / "file.log").write_bytes(b"another file of that name")
    (tmp_path / "a" / "b" / "file.log").write_bytes(CONTENT)
    missing = data("https://nowhere.invalid/at%20all/file.log")
    assert fetch(missing) == tmp_path / "a" / "b" / "file.log"


def test_download_of_a_whole_file(tmp_path, server, fetch):
    known = data(f"{server.url}/a%20folder/file.log")
    path = fetch(known)
    assert path == tmp_path / "name" / "file.log"
    assert path.read_bytes() == CONTENT
    assert left(tmp_path) == ["file.log"]
    assert fetch(known) == path
    assert server.asked == 1


@pytest.mark.parametrize(("where", "content", "message"), [
    ("missing", CONTENT, "cannot be downloaded: 404"),
    ("broken", CONTENT, "cannot be downloaded"),
    ("whole", b"other", "has another sha256"),
    ("closed", CONTENT, "put the file file.log below"),
])  # fmt: skip
def test_of_what_is_not_the_file_nothing_is_left(tmp_path, server, fetch, where, content, message):
    if where == "closed":
        server.server_close()
    with refused(message, "try again"):
        fetch(data(f"{server.url}/{where}/file.log", content))
    assert left(tmp_path) == []
