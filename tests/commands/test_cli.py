"""The command line: what it lists, and that bad input ends with one line and exit status 2."""

import subprocess
import sys

from calling import call, succeed
from click.testing import CliRunner

import accelstudy
from accelstudy.commands.main import main
from accelstudy.sensors.models import MODELS


def output(*arguments):
    result = succeed(*arguments)
    assert result.stderr == ""
    return result.stdout


def test_version():
    assert output("--version").split()[-1] == accelstudy.__version__


def completed(words, shell="bash"):
    """What the shell offers for the last of `words`."""
    *_, last = words = ["accelstudy", *words]
    environment = {"_ACCELSTUDY_COMPLETE": f"{shell}_complete", "COMP_WORDS": " ".join(words)}
    number = last if shell == "fish" else str(len(words) - 1)
    result = CliRunner().invoke(
        main, env={**environment, "COMP_CWORD": number}, prog_name="accelstudy"
    )
    return [line.split(",", 1)[-1].split("\t")[0] for line in result.stdout.splitlines()]


def test_the_shell_completes_commands_and_names():
    assert completed(["cali"]) == completed(["cali"], "fish") == ["calibrate"]
    assert completed(["calibrate", "--ang"]) == ["--angle-unit"]
    assert completed(["calibrate", "--angle-unit", "d"]) == ["deg"]
    assert completed(["calibrate", "--model", "bias-scale"]) == [*MODELS]
    assert completed(["calibrate", "--model", "bias+warm"]) == ["bias+warm_up"]
    assert completed(["calibrate", "--model", "diag"]) == ["diag"]  # maybe a file
    assert completed(["schemes", "--approach", "r"]) == ["robot"]
    assert completed(["scheme", "mcl"]) == ["mclaren-24"]
    assert completed(["simulate-campaign", "--effect", "warm"]) == ["warm_up"]
    assert completed(["simulate-campaign", "--noise-effect", "heavy"]) == ["heavy_tails"]


def test_help_imports_nothing_that_takes_long():
    code = (
        "import sys\nfrom accelstudy.commands.main import main\n"
        "main(['--help'], standalone_mode=False)\n"
        "slow = 'numpy', 'scipy', 'pandas', 'sympy', 'matplotlib', 'importlib.metadata'\n"
        "print([m for m in slow if m in sys.modules])"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.splitlines()[-1] == "[]"


# --- the unit of angles --------------------------------------------------------------------------


def test_the_unit_of_angles_is_an_option_and_a_variable(monkeypatch):
    gon = output("schemes", "mclaren-24")
    assert "pole/gon" in gon
    twice = ("scheme", "--angle-unit", "gon", "faces-6", "--angle-unit", "deg")
    assert output(*twice).splitlines()[4].endswith(",-90.000000")  # nose up
    assert output("schemes", "mclaren-24") == gon  # the choice ends with its command
    monkeypatch.setenv("ACCELSTUDY_ANGLE_UNIT", "deg")
    assert "pole/deg" in output("schemes", "mclaren-24")
    assert output("schemes", "mclaren-24", "--angle-unit", "gon") == gon


# --- bad input -----------------------------------------------------------------------------------


def test_a_defect_is_not_taken_for_bad_input(monkeypatch):
    """Only InputError is the user's to mend."""

    def broken(name):
        raise ValueError("a defect")

    monkeypatch.setattr("accelstudy.verbs.tables.get_scheme", broken)
    assert isinstance(call("scheme", "faces-6").exception, ValueError)
