"""What scripts rely on: --quiet, both streams, the exit status, and what is suggested."""

import re
import shlex
import shutil
from contextlib import chdir
from html import unescape
from pathlib import Path

import numpy as np
import pytest
from calling import succeed
from matplotlib.figure import Figure

from accelstudy.basics import suggested
from accelstudy.commands.main import main
from accelstudy.schemes import get_scheme

STATES = {
    "accepted": (),
    "rejected": ("--effect", "quadratic_scale", "--size", 5),
    "cannot tell": ("--sigma-unknown",),
    "implausible": ("--gross", "row_order(first=3, second=4)"),
}
"""What makes a calibration such."""
READ = ("log.csv", "--columns", "fx=0,fy=1,fz=2", "--rate", 50)
EPOCHS = ("plain", "later", "latest")
RESULTS = {
    "import": (*READ, "--no-figure", "--out", "log"),
    "simulate-campaign": ("--out", "again"),
    "apply": ("plain/calibration.json", *READ, "--out", "leveled.csv"),
    "check-sigmas": ("accepted", "--replicates", 2),
    "advise": ("accepted", "--tilt-accuracy", "10mgon", "--tilt-range", "30gon"),
    "data-sheet": ("accepted", "--out", "sheet.yaml"),
    "design": ("--positions", 6, "--starts", 1, "--model", "bias", "--attitudes", "cube", "--out",
               "a.yaml"),
    "schemes": ("faces-6",),
    "effects": (),
    "public": (),
    "calibrate": ("accepted", "--out", "plain"),
    "lot": ("accepted", "rejected", "--out", "lot"),
    "compare": ("plain/calibration.json", "plain/calibration.json", "--out", "compared"),
    "history": (*(f"{name}/calibration.json" for name in EPOCHS), "--date", "2024-01-01", "--date",
                "2024-07-01", "--date", "2025-01-01", "--out", "years"),
}  # fmt: skip
"""Arguments of commands that have --quiet."""
HAVE = {
    "import": r"^campaign: log \(20 positions\)$",
    "simulate-campaign": r"^campaign: again \(24 positions\)$",
    "apply": r"^3000 of 3000 rows leveled: leveled.csv$", "check-sigmas": "sd_empirical",
    "advise": "tilt accuracy: roll", "data-sheet": "^sigma of the mean of a position: 2 mm/s²$",
    "design": "roll/gon", "schemes": "faces-6", "effects": "^warm_up: ", "public": "^xsens-mti: ",
    "calibrate": "^ACCEPTED: ", "compare": "^UNCHANGED: ", "history": "^(UN)?CHANGED: ",
    "lot": "is missing",
}  # fmt: skip
"""What its result has."""

UNDRAWN = "accelstudy.campaign.calibration.output.residual_figure", lambda *_: Figure()


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A folder with a campaign of each state, and a log; its name has a space."""
    folder = tmp_path_factory.mktemp("my work")
    rng, holds = np.random.default_rng(1), np.repeat(get_scheme("fibonacci-20").directions, 150, 0)
    readings = -9.80665 * holds + 0.005 * rng.standard_normal(holds.shape)
    with chdir(folder), pytest.MonkeyPatch.context() as patch:
        patch.setattr(*UNDRAWN)
        np.savetxt("log.csv", readings, "%.5f", delimiter=",")
        for state, options in STATES.items():
            succeed("simulate-campaign", "--out", state, *options)
        for seed, epoch in enumerate(EPOCHS, 11):
            again = (*STATES["accepted"], "--seed", seed, "--truth", f"{epoch}.yaml")
            succeed("simulate-campaign", "--out", f"of-{epoch}", *again)
            succeed("calibrate", f"of-{epoch}", "--out", epoch)
    return folder


@pytest.fixture
def here(made, monkeypatch):
    monkeypatch.chdir(made)
    monkeypatch.setattr(*UNDRAWN)


def quiet(command, *arguments):
    """What a command prints with --quiet: a part of what it prints without, and all warnings."""
    force = ["--force"] if "force" in {p.name for p in main.commands[command].params} else []
    without, with_it = (succeed(command, *arguments, *force, *more) for more in ((), ("--quiet",)))
    assert with_it.stderr == without.stderr
    assert all(line.startswith("warning: ") for line in without.stderr.splitlines())
    whole = iter(without.stdout.splitlines())
    assert all(line in whole for line in with_it.stdout.splitlines())
    return with_it.stdout


def test_each_command_with_the_option_is_tested():
    """Those of diagnose and plan take longer, and are tested with all else that they say."""
    has = {n for n, c in main.commands.items() if "quiet" in {p.name for p in c.params}}
    assert has == {*RESULTS, "diagnose", "plan"}


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("command", RESULTS)
def test_quiet_leaves_the_result(command):
    assert re.search(HAVE[command], quiet(command, *RESULTS[command]), re.MULTILINE)


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("state", STATES)
def test_quiet_leaves_the_verdict_of_a_calibration(state):
    verdict = quiet("calibrate", state, "--approach", "robot", "--out", f"{state}-calibrated")
    assert verdict.startswith(f"{state.upper()}: ")
    assert verdict.count("\n") == 1


# --- suggestions ---------------------------------------------------------------------------------


def suggestions(text):
    """Arguments of the commands that a text suggests, with files for what stands in capitals."""
    meant = {"LOG": "log.csv", "CAMPAIGN": "accepted"}
    lines = re.findall(r"(?:^|: )accelstudy (.+)$", text, re.MULTILINE)
    return [[meant.get(word, word) for word in shlex.split(line)] for line in lines]


def outs(campaigns):
    """Where the suggested commands write for campaigns."""
    for command in (suggested.calibrate, suggested.diagnose):
        yield from (shlex.split(command(each, "bias", "robot"))[-1] for each in campaigns)
    for each in campaigns:
        yield shlex.split(suggested.apply(f"{each}/calibration.json"))[-1]


def test_no_two_campaigns_share_what_is_suggested(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    campaigns = ("left", "imu/left", "imu/right", "second/imu/left", "my work/left", "/data/left")
    found = [*outs(campaigns)]
    assert len({*found}) == 3 * len(campaigns)
    assert not any("/" in out for out in found)
    assert "imu-left-diagnosis" in found
    assert "my work-left-leveled.csv" in found
    assert len(max(outs(["longer/" * 99]), key=len).encode()) < 255


@pytest.mark.parametrize("typed", [".", "..", "../campaign", "{}", "-campaign", "a/../campaign"])
def test_what_is_suggested_writes_into_no_campaign(tmp_path, monkeypatch, typed):
    """Whatever the folder that the user is in, and however the campaign was typed."""
    place = {".": "campaign", "..": "campaign/inside"}.get(typed, "elsewhere")
    (tmp_path / place).mkdir(parents=True)
    (tmp_path / place / "a").mkdir()
    monkeypatch.chdir(tmp_path / place)
    name = "-campaign" if typed == "-campaign" else "campaign"
    source = tmp_path / ("elsewhere" if typed[0] in "-a" else "") / name
    succeed("simulate-campaign", f"--out={source}", "--scheme", "faces-6", "--force")
    line = suggested.calibrate(typed.format(source), "bias", "gravity")
    (arguments,) = suggestions(line)
    succeed(*arguments)
    assert len([*tmp_path.rglob("calibration.json")]) == 1
    assert not [*source.rglob("calibration.json")]


@pytest.mark.usefixtures("here")
def test_all_that_is_suggested_runs_from_the_log_to_the_last_page(monkeypatch):
    """Two sensors of one log, with the files where the user has them."""
    shutil.copytree("rejected", "imu/left")
    shutil.copytree("accepted", "imu/right")
    printed = "".join(
        succeed("calibrate", f"imu/{side}", "--approach", "robot", "--out", f"both/{side}").stdout
        for side in ("left", "right")
    )
    reading = ("--columns", "fx=0,fy=1,fz=2", "--rate", "50")
    (diagnose, apply) = suggestions(printed)
    succeed(*apply, *reading)
    monkeypatch.setattr("accelstudy.diagnosis.report.output.diagnosis_figures", lambda *_: {})
    done = succeed(*diagnose, "--replicates", "100", "--quiet")
    assert done.stdout == "The model lacks quadratic scale.\n"
    page = Path("imu-left-diagnosis/report.html").read_text(encoding="utf-8")
    steps = suggestions("\n".join(map(unescape, re.findall("<pre>(.*?)</pre>", page))))
    assert [step[0] for step in steps] == ["apply", "export", "calibrate"]
    for command, *arguments in steps:
        succeed(command, *arguments, *(reading if command == "apply" else ()))
    assert "imu-left-diagnosis-leveled.csv" in steps[0]
