"""What a command tells while it works: on a terminal only, and never if quiet."""

import io
from contextlib import redirect_stderr

import pytest

from accelstudy.basics.progress import feedback, show, stage, track, warn


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture(autouse=True)
def terminal(monkeypatch):
    monkeypatch.setenv("TERM", "xterm")


def work():
    """Two stages, one within the other; what passes through them is what was put in."""
    with stage("null simulation"):
        done = list(track([1, 2, 3], "sets"))
    with stage("download", 10) as advance:
        advance(4)
    return done


def seen(screen, quiet=False):
    """What `screen` shows after the work."""
    with redirect_stderr(screen), feedback(quiet):
        assert work() == [1, 2, 3]
    return screen.getvalue()


def test_what_takes_long_shows_on_a_terminal_alone(monkeypatch):
    """Not if quiet, in a pipe, or used from Python."""
    text = seen(Terminal())
    lines = text.split("\r\x1b[2K")
    assert lines == [
        *("", "null simulation", "sets 0 %", "sets 33 %", "sets 66 %", "sets 100 %", "", ""),
        *("download 0 %", "download 40 %", ""),
    ]
    assert seen(Terminal(), quiet=True) == seen(io.StringIO()) == ""
    with redirect_stderr(Terminal()) as screen:
        work()
    assert screen.getvalue() == ""
    monkeypatch.setenv("TERM", "dumb")
    assert seen(Terminal()) == ""


def test_a_stage_goes_when_the_work_fails():
    def fails():
        with feedback(), stage("null simulation"):
            raise ValueError("bad")

    screen = Terminal()
    with redirect_stderr(screen), pytest.raises(ValueError, match="bad"):
        fails()
    bar, after = screen.getvalue().rsplit("\x1b[2K", 1)  # which clears the line
    assert "null simulation" in bar
    assert after == ""
    assert "sets" in seen(Terminal())


def test_a_text_of_a_file_does_not_control_the_terminal(capsys):
    show("name \x1b[31m\nsecond line\x07")
    warn("column \x1b]0;title\x07")
    said = capsys.readouterr()
    assert said.out == "name \\x1b[31m\nsecond line\\x07\n"
    assert said.err == "warning: column \\x1b]0;title\\x07\n"
