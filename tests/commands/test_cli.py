"""The command line: what it lists, and that bad input ends with one line and exit status 2."""

import re
import subprocess
import sys

import click
import numpy as np
import pandas as pd
import pytest
import yaml
from calling import call, succeed
from click.testing import CliRunner
from study_helpers import NINE, PROVENANCE, content, grid

import accelstudy
from accelstudy.commands.main import main
from accelstudy.files.tables import write_table
from accelstudy.schemes import get_scheme, scheme_families, scheme_names
from accelstudy.sensors.models import MODELS


def output(*arguments):
    result = succeed(*arguments)
    assert result.stderr == ""
    return result.stdout


def test_version():
    assert output("--version").split()[-1] == accelstudy.__version__


def test_help_names_every_command():
    text = output("--help")
    assert "..." not in text.partition("Campaigns")[2]  # what each does fits into its line
    for name, command in main.commands.items():
        assert re.search(rf"^  {name} ", text, re.MULTILINE)
        assert "Usage:" in output(name, "--help")
        for option in command.params:
            if isinstance(option, click.Option):
                assert re.match(r"[A-Z'].*[.\]]$", option.help or ""), (name, option.name)


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


# --- what there is to choose from ----------------------------------------------------------------


def rows_of(text, names):
    """Words of the lines that begin with one of the names."""
    return {row[0]: row for row in map(str.split, text.splitlines()) if row and row[0] in names}


def test_all_schemes_by_default():
    text, table = output("schemes"), output("schemes", "--quiet").strip("\n")
    rows = rows_of(text, scheme_names())
    assert [*rows] == [*scheme_names()]
    assert all(family in text for family in scheme_families())
    assert rows["faces-6"][3:5] == ["6/9", "-"]
    assert rows["faces-6"][-3:] == ["alpha_yz,", "alpha_zy,", "alpha_zx"]
    assert rows["mclaren-24"][6] == "0.0667"  # m = 1/15
    assert table in text
    assert len(table.splitlines()) == 1 + len(scheme_names())


def test_directions_of_a_scheme():
    head, names, *lines = output("scheme", "faces-6").splitlines()
    assert head.startswith("# ")
    assert get_scheme("faces-6").source in head
    assert names == "position,x,y,z,roll_gon,pitch_gon"
    rows = [[float(cell) for cell in line.split(",")[1:]] for line in lines]
    level, nose = (next(row[3:] for row in rows if row[axis] == 1) for axis in (2, 0))
    assert (len(rows), level, nose[1]) == (6, [0, 0], -100)  # z down, and x down
    assert all(np.linalg.norm(row[:3]) == pytest.approx(1) for row in rows)


# --- the unit of angles --------------------------------------------------------------------------


def test_angles_in_degrees(monkeypatch):
    gon = output("schemes", "mclaren-24")
    assert "pole/gon" in gon
    assert "100 gon = 90°" in gon
    for arguments in (
        ("scheme", "faces-6", "--angle-unit", "deg"),
        ("scheme", "--angle-unit", "gon", "faces-6", "--angle-unit", "deg"),
    ):
        table = output(*arguments).splitlines()
        assert table[1].endswith("roll_deg,pitch_deg")
        assert table[4].endswith(",-90.000000")  # nose up
        assert output("schemes", "mclaren-24") == gon  # the choice ends with its command
    assert " … 28.6 mdeg\n" in output("effects", "--angle-unit", "deg")
    assert " … 31.8 mgon\n" in output("effects")
    monkeypatch.setenv("ACCELSTUDY_ANGLE_UNIT", "deg")
    assert "pole/deg" in output("schemes", "mclaren-24")
    assert output("schemes", "mclaren-24", "--angle-unit", "gon") == gon


# --- a study -------------------------------------------------------------------------------------


def test_cells(tmp_path):
    base, over = tmp_path / "base.yaml", tmp_path / "over.yaml"
    base.write_text(yaml.safe_dump(content(grids=[grid(schemes=["faces-6", "mclaren-24"])])))
    _, *lines, gap, effort = output("cells", base).splitlines()
    assert (gap, effort) == ("", "4 cells, up to 240 calibrations")
    rows = [line.split(maxsplit=3) for line in lines]
    assert rows[1:] == [
        [f"{NINE}/faces-6/robot", "9", "60"],
        [f"{NINE}/mclaren-24/gravity", "15", "60"],
        [f"{NINE}/mclaren-24/robot", "63", "60"],
    ]
    assert rows[0][3].startswith("rank 6 of 9: alpha_yz, ")
    over.write_text(yaml.safe_dump({"grids": [grid(approaches="robot", replicates=7)]}))
    assert output("cells", base, over).splitlines()[1].split() == [rows[3][0], "63", "7"]


def test_claims(tmp_path):
    row = {
        "claim": "c", "section": "4.2", "statement": "it holds", "unit": "%", "paper": 50.0,
        "ours": 41.25, "ci95_low": 40.0, "ci95_high": 42.0, "verdict": "reproduced",
        "sentence": "So it is.",
    }  # fmt: skip
    write_table(tmp_path / "claims.parquet", pd.DataFrame([row]), PROVENANCE)
    assert output("claims", tmp_path).splitlines()[2:] == [
        "| 4.2 | it holds | 50.0 % | 41.2 % (40.0 … 42.0) | **reproduced** | So it is. |"
    ]


# --- bad input -----------------------------------------------------------------------------------


def test_a_defect_is_not_taken_for_bad_input(monkeypatch):
    """Only InputError is the user's to mend."""

    def broken(name):
        raise ValueError("a defect")

    monkeypatch.setattr("accelstudy.verbs.tables.get_scheme", broken)
    assert isinstance(call("scheme", "faces-6").exception, ValueError)
