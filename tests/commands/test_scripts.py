"""What commands suggest to type next runs."""

import re
import shlex
import shutil
from html import unescape
from pathlib import Path

import numpy as np
import pytest
from calling import succeed

from accelstudy.basics import suggestions
from accelstudy.schemes import get_scheme


@pytest.fixture
def made(tmp_path_factory, monkeypatch):
    """A folder whose name has a space, with a campaign that is accepted, one that is not, a log."""
    rng, holds = np.random.default_rng(1), np.repeat(get_scheme("fibonacci-20").directions, 150, 0)
    readings = -9.80665 * holds + 0.005 * rng.standard_normal(holds.shape)
    monkeypatch.chdir(tmp_path_factory.mktemp("my work"))
    np.savetxt("log.csv", readings, "%.5f", delimiter=",")
    succeed("simulate-campaign", "--out", "accepted")
    succeed("simulate-campaign", "--out", "rejected", "--effect", "quadratic_scale", "--size", 5)


def commands_in(text):
    """Arguments of the commands that a text suggests, with files for what stands in capitals."""
    meant = {"LOG": "log.csv", "CAMPAIGN": "accepted"}
    lines = re.findall(r"(?:^|: )accelstudy (.+)$", text, re.MULTILINE)
    return [[meant.get(word, word) for word in shlex.split(line)] for line in lines]


def outs(campaigns):
    """Where the suggested commands write for campaigns."""
    for command in (suggestions.calibrate, suggestions.diagnose):
        yield from (shlex.split(command(each, "bias", "robot"))[-1] for each in campaigns)
    for each in campaigns:
        yield shlex.split(suggestions.apply(f"{each}/calibration.json"))[-1]


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
    line = suggestions.calibrate(typed.format(source), "bias", "gravity")
    (arguments,) = commands_in(line)
    succeed(*arguments)
    assert len([*tmp_path.rglob("calibration.json")]) == 1
    assert not [*source.rglob("calibration.json")]


@pytest.mark.usefixtures("made")
def test_all_that_is_suggested_runs_from_the_log_to_the_last_page():
    """Two sensors of one log, with the files where the user has them."""
    shutil.copytree("rejected", "imu/left")
    shutil.copytree("accepted", "imu/right")
    printed = "".join(
        succeed("calibrate", f"imu/{side}", "--approach", "robot", "--out", f"both/{side}").stdout
        for side in ("left", "right")
    )
    reading = ("--columns", "fx=0,fy=1,fz=2", "--rate", "50")
    (diagnose, apply) = commands_in(printed)
    succeed(*apply, *reading)
    done = succeed(*diagnose, "--quiet")
    assert done.stdout == "The model lacks quadratic scale.\n"
    page = Path("imu-left-diagnosis/report.html").read_text(encoding="utf-8")
    steps = commands_in("\n".join(map(unescape, re.findall("<pre>(.*?)</pre>", page))))
    assert [step[0] for step in steps] == ["apply", "export", "calibrate"]
    for command, *arguments in steps:
        succeed(command, *arguments, *(reading if command == "apply" else ()))
    assert "imu-left-diagnosis-leveled.csv" in steps[0]
