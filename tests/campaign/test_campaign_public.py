"""Public measurements: the registry knows the files, and a file is got whole or not at all."""

import hashlib
import threading
from concurrent.futures import ThreadPoolExecutor
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest
from calling import refusal, refused, succeed
from places import DATA, needs_data

from accelstudy.basics.errors import InputError, UnknownNameError
from accelstudy.campaign.format import read_campaign
from accelstudy.campaign.importing import public
from accelstudy.campaign.importing.logs import import_log
from accelstudy.campaign.importing.public import (
    PublicData,
    fetch,
    import_settings,
    next_attempt,
    public_data,
    public_file,
    read_record,
    record_public,
)

CONTENT = bytes(range(256)) * 64


def data(url, content=CONTENT):
    return PublicData(
        description="a file", url=url, sha256=hashlib.sha256(content).hexdigest(), licence="MIT"
    )


class Server(BaseHTTPRequestHandler):
    """Serves CONTENT; the path says how badly: /plain without ranges, /broken only half of
    it, /slow half of it, and to the first who asks the rest when it is told to."""

    def do_GET(self):
        wanted = self.headers.get("Range")
        self.server.ranges.append(wanted)
        start = 0
        if wanted and not self.path.startswith("/plain"):
            start = int(wanted.removeprefix("bytes=").removesuffix("-"))
        if self.path.startswith("/missing"):
            return self.send_error(404)
        if start >= len(CONTENT):
            return self.send_error(416)
        body = CONTENT[start:]
        self.send_response(206 if start else 200)
        if start:
            self.send_header("Content-Range", f"bytes {start}-{len(CONTENT) - 1}/{len(CONTENT)}")
        length = "many" if self.path.startswith("/odd") else str(len(body))
        self.send_header("Content-Length", length)
        self.end_headers()
        half = len(body) // 2
        self.wfile.write(body[:half])
        if len(self.server.ranges) == 1 and self.path.startswith("/slow"):
            self.server.half_sent.set()
            self.server.go_on.wait(60)
        if not self.path.startswith("/broken"):
            self.wfile.write(body[half:])

    def log_message(self, *arguments):
        pass


@pytest.fixture
def server(monkeypatch):
    monkeypatch.setenv("no_proxy", "127.0.0.1")
    with ThreadingHTTPServer(("127.0.0.1", 0), Server) as running:
        running.ranges = []
        running.half_sent, running.go_on = threading.Event(), threading.Event()
        running.url = f"http://127.0.0.1:{running.server_port}"
        thread = threading.Thread(target=running.serve_forever, args=(0.01,))
        thread.start()
        yield running
        running.shutdown()
        thread.join()


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


@needs_data
@pytest.mark.parametrize("name", public_data())
def test_the_registry_knows_the_files(name):
    path = public_file(name, DATA)
    assert path.is_relative_to(DATA)
    assert path.name == public_data()[name].file_name


# As far as an independent detector of holds, and the authors, tell their number.
N_POSITIONS = {
    **{"xsens-mti": 38, "mpu9150-0": 23, "mpu9150-1": 23, "mpu9150-2": 23, "mpu6050": 10},
    **{"innalabs-24": 24, "innalabs-31": 31, "innalabs-49": 49, "ferraris-annotated": 6},
    **{"mpu6050-static": 1, "ck-explorer": 160},
}


@needs_data
@pytest.mark.parametrize("name", [name for name in public_data() if public_data()[name].settings])
def test_the_registry_imports_the_files(name):
    campaign, _ = import_log(public_file(name, DATA), import_settings(name))
    assert campaign.name == name
    assert campaign.n_positions == N_POSITIONS.get(name, campaign.n_positions)


@needs_data
def test_command(tmp_path):
    result = succeed("public", "mpu6050", "--out", tmp_path / "out", "--folder", DATA)
    assert "holds: 10" in result.output
    assert read_campaign(tmp_path / "out").sensor == "MPU-6050"
    assert (tmp_path / "out" / "segmentation.png").exists()


def test_command_lists():
    result = succeed("public")
    for name, entry in public_data().items():
        assert f"{name}: {entry.description}\n    {entry.licence}, {entry.url}\n" in result.output


@pytest.mark.parametrize(("arguments", "message"), [
    (["xsens"], "unknown public data 'xsens'; did you mean 'xsens-mti'?"),
    (["ferraris-sections", "--out", "out"], "'ferraris-sections' hold no forces"),
    (["xsens-mti"], "--out: give the folder of the campaign"),
])  # fmt: skip
def test_command_refuses(arguments, message):
    assert message in refusal("public", *arguments)


def test_an_unknown_name(tmp_path):
    with pytest.raises(UnknownNameError, match="did you mean 'xsens-mti'"):
        public_file("xsens_mti", tmp_path)


def test_a_file_that_is_there_is_not_downloaded(tmp_path):
    (tmp_path / "a" / "b").mkdir(parents=True)
    (tmp_path / "a" / "file.log").write_bytes(b"another file of that name")
    (tmp_path / "a" / "b" / "file.log").write_bytes(CONTENT)
    missing = data("file:///nowhere/at%20all/file.log")
    assert fetch(missing, tmp_path, tmp_path / "new") == tmp_path / "a" / "b" / "file.log"


def test_download_of_a_whole_file(tmp_path):
    source = tmp_path / "source of data" / "file.log"
    source.parent.mkdir()
    source.write_bytes(CONTENT)
    folder = tmp_path / "folder"
    path = fetch(data(source.as_uri()), folder, folder / "name")
    assert path == folder / "name" / "file.log"
    assert path.read_bytes() == CONTENT
    assert left(folder) == ["file.log"]
    source.unlink()
    assert fetch(data(source.as_uri()), folder, folder / "name") == path


@pytest.mark.parametrize("have", [0, 1000, len(CONTENT)])
@pytest.mark.parametrize("way", ["ranges", "plain"])
def test_an_interrupted_download_goes_on(tmp_path, server, have, way):
    (tmp_path / "file.log.part").write_bytes(CONTENT[:have])
    path = fetch(data(f"{server.url}/{way}/file.log"), tmp_path, tmp_path)
    assert path.read_bytes() == CONTENT
    assert left(tmp_path) == ["file.log"]
    assert server.ranges == [f"bytes={have}-" if have else None]


def test_a_broken_connection_keeps_what_has_come(tmp_path, server):
    broken = data(f"{server.url}/broken/file.log")
    with pytest.raises(InputError, match="try again"):
        fetch(broken, tmp_path, tmp_path)
    assert left(tmp_path) == ["file.log.part"]
    # It has gone on, each time with half of what was missing, until a try brought nothing.
    assert server.ranges[:2] == [None, f"bytes={len(CONTENT) // 2}-"]
    assert server.ranges[-1] == f"bytes={len(CONTENT) - 1}-"
    assert fetch(data(f"{server.url}/ranges/file.log"), tmp_path, tmp_path).exists()


def test_two_downloads_at_once(tmp_path, server):
    slow = data(f"{server.url}/slow/file.log")
    with ThreadPoolExecutor(1) as pool:
        first = pool.submit(fetch, slow, tmp_path, tmp_path)
        assert server.half_sent.wait(60)
        second = fetch(slow, tmp_path, tmp_path)
        server.go_on.set()
        assert first.result() == second
    assert second.read_bytes() == CONTENT
    assert left(tmp_path) == ["file.log"]


@pytest.mark.parametrize("part", [b"", b"wrong", b"too long" * len(CONTENT)])
def test_a_wrong_checksum(tmp_path, server, part):
    """Nothing is left that the next download would go on with."""
    (tmp_path / "file.log.part").write_bytes(part)
    other = data(f"{server.url}/ranges/file.log", b"" if not part else CONTENT)
    with refused("sha256"):
        fetch(other, tmp_path, tmp_path)
    assert left(tmp_path) == []


@pytest.mark.parametrize("where", ["/missing", None])
def test_a_source_that_does_not_answer(tmp_path, server, where):
    url = f"{server.url}{where}/file.log" if where else (tmp_path / "none" / "file.log").as_uri()
    with pytest.raises(InputError, match=r"cannot be downloaded.*put the file file\.log below"):
        fetch(data(url), tmp_path, tmp_path)


def test_a_record_asks_for_another_attempt_until_the_file_is_there(tmp_path, monkeypatch):
    source = tmp_path / "source" / "file.log"
    monkeypatch.setattr(public, "public_data", lambda: {"file": data(source.as_uri())})
    path = tmp_path / "file.json"

    def record():
        record_public("file", tmp_path / "folder", path, next_attempt(path))
        return read_record(path)

    assert next_attempt(path) == 1
    first = record()
    assert first["file"] is None
    assert "cannot be downloaded: No such file or directory; try again" in first["error"]
    assert next_attempt(path) == 2
    source.parent.mkdir()
    source.write_bytes(CONTENT)
    second = record()
    assert second["error"] is None
    assert Path(second["file"]).read_bytes() == CONTENT
    assert second["attempt"] == next_attempt(path) == 2
    Path(second["file"]).unlink()
    assert next_attempt(path) == 3


def test_a_server_that_cannot_count(server, tmp_path):
    path = fetch(data(f"{server.url}/odd/file.log"), tmp_path, tmp_path / "new")
    assert path.read_bytes() == CONTENT
