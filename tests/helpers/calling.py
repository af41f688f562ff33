"""Commands within the process of the tests, and how they and what they call refuse their input."""

from contextlib import contextmanager

import pytest
from click.testing import CliRunner

from accelstudy.basics.errors import InputError
from accelstudy.commands.main import main


def call(*words):
    """Result of a command."""
    return CliRunner().invoke(main, [str(word) for word in words])


def succeed(*words):
    """Result of a command that must end well."""
    result = call(*words)
    assert result.exit_code == 0, f"{words}: {result.output}{result.exception!r}"
    return result


def refusal(*words):
    """The one line on stderr by which a command refuses its input."""
    result = call(*words)
    assert result.exit_code == 2, result.output
    assert result.stdout == ""
    assert result.stderr.startswith("error: ")
    assert result.stderr.count("\n") == 1
    return result.stderr


@contextmanager
def refused(*parts, start=""):
    """Let the block end with an `InputError` of one line that has these parts."""
    with pytest.raises(InputError) as caught:
        yield caught
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith(start)
    for part in parts:
        assert part in message
