"""Effects of each family, noise effects and gross errors through the commands, pages included.

What is registered is taken from the registries, so that something new is covered by itself.
"""

import json

import gross
import pytest
from calling import call
from page_helpers import assert_sound, text_of

from accelstudy.campaign.format import read_campaign, write_campaign
from accelstudy.effects import effect_names, get_effect
from accelstudy.noise_effects import noise_effect_names
from accelstudy.sensors.models import get_model

BASE = {effect.name for effect in get_model("bias-scale-nonorthogonality").effects}
HOLDS = ("--temperature", "15:40", "--temperature-order", "random", "--vibration", "0:1",
         "--yaw", "random", "--order", "random")  # fmt: skip
FAMILIES = {get_effect(name).family or name: name for name in effect_names() if name not in BASE}
"""An effect of each family; those of one family look alike to all that follows."""
ADDED = [
    *(("--effect", name) for name in FAMILIES.values()),
    *(("--noise-effect", name) for name in noise_effect_names()),
]
CASES = {
    "nothing": (),
    "nothing-unknown-sigma": ("--no-sigma-known",),
    "sigma-too-small": ("--noise-effect", "noise_level(kappa=6)"),
    "fx-fy": ("--scheme", "fibonacci-30"),
    **{name: (option, name) for option, name in ADDED},
    **dict.fromkeys(("rows", "unit", "outlier"), ()),
    "gravity-outlier": ("--approach", "gravity"),
    "gravity-few": ("--approach", "gravity", "--scheme", "fibonacci-10"),
}  # fmt: skip
GROSS = {
    "fx-fy": lambda campaign: gross.axes(campaign, 2, 1, 3),
    "rows": lambda campaign: gross.rows(campaign, 3, 9),
    "unit": lambda campaign: gross.unit(campaign, force=0.102),
    **dict.fromkeys(("outlier", "gravity-outlier"), lambda campaign: gross.bumped(campaign, 7)),
}
"""What is wrong with the data."""
FIGURES = {
    **dict.fromkeys(("nothing-unknown-sigma", "fx-fy", "gravity-few"), "composed"),
    "gravity-outlier": "drawn",
}
"""Those of each verdict are composed where diagnoses are written, and drawn in the golden set."""


def run(*arguments, fails=False):
    result = call(*arguments)
    assert result.exit_code in ((0, 2) if fails else (0,)), f"{arguments}: {result.output}"
    assert "could not be" not in result.output
    return result


def read(path):
    def refuse(constant):
        raise AssertionError(f"{constant} in {path.name}")

    return json.loads(path.read_text(encoding="utf-8"), parse_constant=refuse)


@pytest.mark.parametrize("case", CASES)
def test_three_commands_end_well_and_agree(case, tmp_path, request):
    if case in FIGURES:
        request.getfixturevalue(FIGURES[case])
    campaign, options = tmp_path / "c", CASES[case]
    scheme = () if "--scheme" in options else ("--scheme", "fibonacci-20")
    run("simulate-campaign", "--out", campaign, *scheme, *HOLDS, *options)
    approach = "gravity" if "gravity" in options else "robot"
    with_approach = ("--approach", approach)
    if case in GROSS:
        write_campaign(GROSS[case](read_campaign(campaign)), campaign, plausible=False)
    fails = case in GROSS
    told = run("calibrate", campaign, *with_approach, "--out", tmp_path / "cal", fails=fails)
    calibration = None
    if told.exit_code:  # a unit that is not read, or no solution
        assert told.stderr.count("\n") == 1
        assert "look" in told.stderr, "no cause is named"
    else:
        calibration = read(tmp_path / "cal/calibration.json")["quality"]
        page = (tmp_path / "cal/report.html").read_text(encoding="utf-8")
        assert_sound(page)
        assert " ".join(calibration["verdict"].split()) in text_of(page)
        assert f"{calibration['state'].upper()}: " in told.stdout
    said = run("diagnose", campaign, *with_approach, "--out", tmp_path / "dia")
    diagnosis = read(tmp_path / "dia/diagnosis.json")
    page = (tmp_path / "dia/report.html").read_text(encoding="utf-8")
    assert_sound(page)
    assert said.stdout.splitlines()[0] in text_of(page)
    assert "What to do next" in text_of(page)
    if calibration is None:
        assert diagnosis["verdict"] == "gross_error"
    else:
        _assert_agree(calibration, diagnosis)


def _assert_agree(calibration, diagnosis):
    """What one command says, the other does not contradict."""
    state, verdict = calibration["state"], diagnosis["verdict"]
    names = {effect["name"] for effect in diagnosis["effects"]}
    error = calibration["gross_error"]
    if error is not None:
        assert state == "implausible"
        assert verdict == "gross_error"
        assert error["name"] in names
        return  # the diagnosis goes on with mended data
    assert not names & {"unit_error", "axis_error", "row_order"}
    test = calibration["global_test"]
    if test is not None:
        assert diagnosis["global_test"]["p_value"] == pytest.approx(test["p_value"], rel=1e-6)
    if state == "rejected":
        assert verdict != "no_effect"
    if state == "accepted":
        assert "noise_level" not in names
    known = {s["position"] for s in diagnosis["suspects"]}
    known |= {effect.get("position") for effect in diagnosis["effects"]}
    assert {s["position"] for s in calibration["suspects"]} <= known
