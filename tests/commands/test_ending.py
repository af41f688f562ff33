"""How commands end: one line and an exit status, whatever stops them."""

import os
import re
import signal
import subprocess
import sys

import click
import pytest
from calling import refusal
from click.testing import CliRunner

from accelstudy.basics.errors import InputError
from accelstudy.commands.main import Commands

PLAN = ["plan", "--tilt-accuracy", "10mgon", "--sigma", "2mm/s2"]


def started(code, *arguments, **options):
    """Run `accelstudy` in a process of its own, some code before."""
    code += "\nfrom accelstudy.__main__ import run\nrun()"
    command = [sys.executable, "-c", code, *arguments]
    return subprocess.run(command, stderr=subprocess.PIPE, text=True, check=False, **options)


@pytest.mark.parametrize("module", ["click", "accelstudy.planning.answer"])
def test_an_interrupt_of_an_import_is_one_line(module):
    code = (
        "import signal, sys\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "class Ctrl:\n"
        "    def find_spec(self, name, path, target=None):\n"
        f"        if name == {module!r}: signal.raise_signal(signal.SIGINT)\n"
        "sys.meta_path.insert(0, Ctrl())"
    )
    ended = started(code, *PLAN)
    assert ended.returncode == 130
    assert ended.stderr.splitlines()[-1] == "interrupted"
    assert "Traceback" not in ended.stderr


def test_a_closed_stream_is_no_file_that_a_command_opens(tmp_path):
    """A stream that is closed at the start leaves its number to the first file that is opened."""
    words = ("simulate-campaign", "--scheme", "faces-6", "--out", tmp_path / "new", "--quiet")
    code = 'exec "$@" 0<&- 1>&- 2>&-'
    command = ["sh", "-c", code, "sh", sys.executable, "-m", "accelstudy", *words]
    ended = subprocess.run(command, capture_output=True, check=False)
    assert (ended.returncode, ended.stderr) == (0, b"")
    assert b"campaign: new" not in b"".join(
        path.read_bytes() for path in (tmp_path / "new").iterdir()
    )
    refused = subprocess.run([*command[:-2], tmp_path], capture_output=True, check=False)
    assert refused.returncode == 2


@pytest.mark.parametrize("words", [
    ("simulate-campaign", "--out", "a\udcff"), ("calibrate", "a\udcff", "--out", "new"),
    ("calibrate", "x" * 5000, "--out", "new"),
])  # fmt: skip
def test_what_no_file_can_be_named_is_one_line(words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    said = refusal(*words)
    assert re.fullmatch(r"error: .*(no name of a file in UTF-8|too long for .*)\n", said)
    assert not list(tmp_path.iterdir())


def one(function):
    """Result of a command line with one command."""
    return CliRunner().invoke(Commands(commands=[click.command("one")(function)]), ["one"])


@pytest.fixture
def not_in_the_background():
    """Ctrl-C arrives, also where the tests run in the background of a shell, which ignores it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("error", [InputError, ValueError, ImportError])
@pytest.mark.usefixtures("not_in_the_background")
def test_an_interrupt_is_no_error_of_a_file(error, number):
    """Whatever a library makes of it, as pandas of one that comes while it reads."""

    def read():
        try:
            signal.raise_signal(number)
        except KeyboardInterrupt:
            raise error("log.csv: some line has too many columns") from None

    before = signal.getsignal(number)
    result = one(read)
    assert (result.exit_code, result.stderr) == (128 + number, "interrupted\n")
    assert signal.getsignal(number) is before


def test_an_error_of_the_system_is_one_line():
    result = one(lambda: os.stat("/nowhere/at/all"))
    assert result.stderr == "error: /nowhere/at/all: No such file or directory\n"
    assert result.exit_code == 2


@pytest.mark.parametrize("arguments", [["catalogue", "models"], ["plan", "--help"]])
def test_a_full_disk_behind_the_output_is_one_line(arguments):
    with open("/dev/full", "w") as full:
        ended = started("", *arguments, stdout=full)
    assert ended.stderr == "error: standard output: No space left on device\n"
    assert ended.returncode == 2


def test_a_reader_that_needs_no_more_is_no_error():
    end, start = os.pipe()
    os.close(end)
    ended = started("", "catalogue", "models", stdout=start)
    os.close(start)
    assert ended.stderr == ""


def test_a_command_needs_no_backend_of_figures_and_no_sign_of_the_terminal():
    code = "import atexit, os\natexit.register(lambda: __import__('matplotlib.figure'))"
    environment = {**os.environ, "MPLBACKEND": "nonsense", "PYTHONIOENCODING": "cp1250"}
    ended = started(code, "catalogue", "effects", env=environment, stdout=subprocess.DEVNULL)
    assert (ended.returncode, ended.stderr) == (0, "")
