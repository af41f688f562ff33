"""Files of the user: errors name the file that was read, and none is read without end."""

import json
import os
from pathlib import Path

import pytest
from calling import refused

from accelstudy.basics.errors import InputError
from accelstudy.campaign.calibration.sensor_calibration import read_calibration
from accelstudy.campaign.importing.formats import read_table
from accelstudy.files import reading
from accelstudy.files.reading import read_layer
from accelstudy.files.tables import open_parquet

UNREADABLE = Path("/proc/self/mem")  # it opens, and its first byte cannot be read


def read_parquet(path):
    with open_parquet(path) as file:
        return file.read()


READERS = (read_layer, read_calibration, read_table, read_parquet)


@pytest.mark.parametrize("read", READERS)
def test_an_error_of_the_disk_names_the_file(read, tmp_path):
    for suffix in (".yaml", ".mat", ".parquet"):
        path = tmp_path / f"input{suffix}"
        path.symlink_to(UNREADABLE)
        with pytest.raises(InputError, match=rf"^{path}: cannot be read: \w[^\n]*$"):
            read(path)


@pytest.mark.parametrize("read", [read_layer, read_calibration])
def test_a_device_that_never_ends_is_refused(read, monkeypatch):
    for name in ("MAX_BYTES", "LARGEST_YAML"):
        monkeypatch.setattr(reading, name, 3_000_000)
    with pytest.raises(InputError, match=r"^/dev/zero: larger than 3 MB; is"):
        read("/dev/zero")


@pytest.mark.parametrize("read", READERS)
def test_what_no_file_can_be_is_one_line(read, tmp_path):
    for name in ("\0", "x" * 5000, "a\ud800", str(tmp_path / "\xff" / ("y/" * 4000))):
        with pytest.raises(InputError, match=r"^[^\n]{,200}$"):
            read(name)
    with pytest.raises(InputError, match=r"a folder|calibration.json: no such file"):
        read(tmp_path)
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)  # nobody writes to it, so to open it would last for ever
    with pytest.raises(InputError, match=r"pipe: a named pipe; give a file$"):
        read(pipe)


def test_texts_of_a_file_are_printable_lines(tmp_path):
    path = tmp_path / "file.yaml"
    path.write_text('a\u00a0b: [" c\\nd\\e[31m ", "\\t", "C:\\\\ x"]\n', encoding="utf-8")
    assert read_layer(path) == {"a\u00a0b": [" c d\\x1b[31m ", "\t", "C:\\ x"]}
    path.write_text(json.dumps({"a": "b\x1b\nc\ud800"}), encoding="utf-8")
    assert reading.read_json(path, "") == {"a": "b\\x1b c\\ud800"}


def test_a_pipe_is_read():
    end, start = os.pipe()
    os.write(start, b"a: 1\r\nb: \xc3\xa4\r\n")
    os.close(start)
    assert read_layer(f"/dev/fd/{end}") == {"a": 1, "b": "ä"}
    os.close(end)


BAD_FILES = {
    "deep": ("study: " + "[" * 700, "not valid YAML: nested too deeply"),
    "large": (f"models: [{'bias,' * 200_000}]\n", "larger than 1 MB; is it the right file?"),
}  # fmt: skip


@pytest.mark.parametrize(
    ("text", "expected"), [(t, e) for t, *e in BAD_FILES.values()], ids=[*BAD_FILES]
)
def test_what_is_no_mapping_in_yaml_is_one_line(text, expected, tmp_path):
    path = tmp_path / "study.yaml"
    path.write_text(text)
    with refused(*expected, start=f"{path}: "):
        read_layer(path)
