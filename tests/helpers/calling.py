"""Commands within the process of the tests."""

from click.testing import CliRunner

from accelstudy.commands.main import main


def call(*words):
    """Result of a command."""
    return CliRunner().invoke(main, [str(word) for word in words])


def succeed(*words):
    """Result of a command that must end well."""
    result = call(*words)
    assert result.exit_code == 0, f"{words}: {result.output}"
    return result


def refusal(*words):
    """The one line on stderr by which a command refuses its input."""
    result = call(*words)
    assert result.exit_code == 2, result.output
    assert result.stdout == ""
    assert result.stderr.startswith("error: ")
    assert result.stderr.count("\n") == 1
    return result.stderr
