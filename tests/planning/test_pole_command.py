"""The command `pole`: from a calibration and from linear theory, and what it refuses."""

import json

import numpy as np
import pytest
from calling import call, refusal

from accelstudy.basics.units import MGON
from accelstudy.campaign.calibration.applying import read_calibration
from accelstudy.files.tables import read_origin, read_table
from accelstudy.pole import output
from accelstudy.pole.geometry import leaning

FILES = {"pole.json", "budget.parquet", "monte-carlo.parquet", "budget.svg", "budget.png"}
QUICK = ("--sensor", "adxl355", "--replicates", "20")


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory):
    """Folder with a campaign and its calibration."""
    folder = tmp_path_factory.mktemp("pole")
    assert call("simulate-campaign", "--out", folder / "campaign").exit_code == 0
    done = call("calibrate", folder / "campaign", "--approach", "robot", "--out", folder / "done")
    assert done.exit_code == 0, done.output
    return folder / "done/calibration.json"


def test_a_calibration_of_ones_own(calibrated, tmp_path):
    done = call("pole", *QUICK, "--calibration", calibrated, "--out", tmp_path / "pole")
    assert done.exit_code == 0, done.output
    assert {path.name for path in (tmp_path / "pole").iterdir()} == FILES
    content = json.loads((tmp_path / "pole/pole.json").read_text(encoding="utf-8"))
    assert str(calibrated) in content["calibration"]
    assert all(sentence in done.stdout for sentence in content["said"])
    table = read_table(tmp_path / "pole/budget.parquet")
    assert read_origin(tmp_path / "pole/budget.parquet")["seed"] == 1
    # Upright, it is what `apply` says of roll and pitch, over the length.
    calibration = read_calibration(calibrated)
    level = calibration.model.sense(leaning([0.0], [0.0]), calibration.parameters)
    _, sigma = calibration.level(level, 0.0)
    upright = table[(table["tilt_gon"] == 0) & (table["source"] == "calibration")]
    np.testing.assert_allclose(upright["horizontal_m"], 2.0 * np.linalg.norm(sigma), rtol=1e-9)


@pytest.fixture
def undrawn(monkeypatch):
    """Without the rendering of figures, which takes most of the time."""
    monkeypatch.setattr(output, "save", lambda *_: "")


@pytest.mark.usefixtures("undrawn")
def test_the_same_numbers_come_again_and_a_folder_of_others_is_left_alone(tmp_path):
    tables = []
    for _ in range(2):
        done = call("pole", *QUICK, "--tilt-range", "30deg", "--quiet", "--out", tmp_path / "a")
        assert done.exit_code == 0
        tables.append([read_table(tmp_path / f"a/{n}.parquet") for n in ("budget", "monte-carlo")])
    assert all(one.equals(two) for one, two in zip(*tables, strict=True))
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine/notes.txt").write_text("mine")
    refused = call("pole", *QUICK, "--out", tmp_path / "mine")
    assert refused.exit_code == 2
    assert "is not empty" in refused.stderr


@pytest.mark.usefixtures("undrawn")
def test_sigmas_of_roll_and_pitch_alone_will_do(tmp_path):
    done = call("pole", *QUICK, "--tilt-sigma", "10mgon", "--out", tmp_path / "o")
    assert "a calibration that leaves 10 mgon in roll and in pitch" in done.stdout
    table = read_table(tmp_path / "o/budget.parquet")
    upright = table[(table["tilt_gon"] == 0) & (table["source"] == "calibration")]
    np.testing.assert_allclose(upright["horizontal_m"], 2.0 * np.sqrt(2) * 10 * MGON, rtol=1e-9)


@pytest.mark.usefixtures("undrawn")
def test_degrees_are_shown_where_they_are_wanted(tmp_path):
    done = call("pole", *QUICK, "--tilt-range", "30deg", "--angle-unit", "deg",
                "--out", tmp_path / "o")  # fmt: skip
    assert "6 deg    18 deg    30 deg" in done.stdout
    assert " gon" not in done.stdout


@pytest.mark.parametrize(("arguments", "why"), [
    (("--length", "2"), "--length: expected a number with its unit"),
    (("--length", "2gon"), "--length: '2gon': the unit must be one of"),
    (("--tilt-range", "100gon"), "--tilt-range: '100gon': must be"),
    (("--mounting", "frx"), "frame 'frx'"),
    (("--hand-height", "3m"), "above the top of the pole"),
    (("--sensor", "adxl356"), "did you mean 'adxl355'"),
    (("--scheme", "faces-6"), "scheme faces-6"),
    (("--calibration", "no/calibration.json"), "no/calibration.json: no such file"),
    (("--calibration", "c.json", "--scheme", "faces-6"), "--calibration and --scheme exclude"),
    (("--tilt-sigma", "9mgon", "--hold", "2s"), "--tilt-sigma and --hold exclude each other"),
    (("--model", "bias+warm_up"), "warm_up"),
])  # fmt: skip
def test_bad_input_ends_with_one_line(arguments, why, tmp_path):
    assert why in refusal("pole", *QUICK, *arguments, "--out", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_calibration_without_sigmas_is_refused(calibrated, tmp_path):
    content = json.loads(calibrated.read_text(encoding="utf-8"))
    content["covariance"][0][0] = None
    (tmp_path / "c.json").write_text(json.dumps(content), encoding="utf-8")
    refused = refusal("pole", *QUICK, "--calibration", tmp_path / "c.json", "--out", tmp_path / "o")
    assert "covariance: unknown for b_x" in refused


@pytest.mark.usefixtures("undrawn")
def test_a_calibration_that_was_rejected_is_doubted(calibrated, tmp_path):
    content = json.loads(calibrated.read_text(encoding="utf-8"))
    content["quality"]["state"] = "rejected"
    (tmp_path / "c.json").write_text(json.dumps(content), encoding="utf-8")
    done = call("pole", *QUICK, "--calibration", tmp_path / "c.json", "--out", tmp_path / "out")
    assert done.exit_code == 0
    assert "its errors may exceed its sigmas" in done.stderr
