"""Calibrations of one simulated sensor, compared by function and by command."""

import json

import numpy as np
import pytest
from calling import succeed
from page_helpers import assert_sound, text_of
from session_helpers import SENSOR, document, write_document

from accelstudy.basics.errors import InputError
from accelstudy.basics.units import GON, MGON
from accelstudy.basics.units import STANDARD_GRAVITY as G
from accelstudy.campaign.calibration.sensor_calibration import calibration_of
from accelstudy.epochs.history import History
from accelstudy.files.documents import json_text
from accelstudy.leveling.angles import angles_of, wrap_angle
from accelstudy.leveling.error import cap_forces


def calibrated(seed, **options):
    return calibration_of(json.loads(json_text(document(seed, **options))))


def compare(first, second):
    return History((first, second), (), 50 * GON)


def test_the_change_of_roll_and_pitch_is_that_of_readings():
    first = calibrated(1)
    second = calibrated(2, effects=("bias: 0.1, 0.07, -0.1", *SENSOR[1:]))
    c = compare(first, second)
    forces = cap_forces(50 * GON, 5000, second.gravity)
    readings = first.model.sense(forces, first.parameters)
    apart = wrap_angle(angles_of(second.correct(readings)) - angles_of(forces))
    rms = np.sqrt(np.mean(apart**2, axis=0)) / MGON
    np.testing.assert_allclose([c.tilt.roll_mgon, c.tilt.pitch_mgon], rms, rtol=0.01)
    assert [c.parameters[i].name for i in c.change.fewest_changes] == ["b_y"]


def test_another_gravity_is_said_to_change_the_scales():
    one, other = calibrated(1), calibrated(1, gravity=G * (1 + 200e-6))
    assert "in one place, this alone changes each scale by 200 ppm" in compare(one, other).verdict
    assert "Gravity" not in compare(one, one).verdict


def test_what_cannot_be_compared_is_said():
    one = document(1)
    counts = {**one, "unit": "counts", "nominal": {"scale": [1e-3] * 3, "offset": [0.0] * 3}}
    with pytest.raises(InputError, match=r"calibration 2 .*: nominal: "):
        compare(calibration_of(one), calibration_of(counts))
    with pytest.raises(InputError, match=r"calibration 2 .*: no sigmas"):
        compare(calibration_of(one), calibrated(1, scheme="fibonacci-9", sigma_known=False))
    other = calibrated(1, model="quadratic_scale", scheme="fibonacci-30")
    with pytest.raises(
        InputError,
        match=r"effects: quadratic_scale, but bias, scale and .*; calibrate both campaigns",
    ):
        compare(calibration_of(one), other)


@pytest.mark.usefixtures("composed")
@pytest.mark.parametrize("changed", [True, False])
def test_the_command_writes_what_it_says(changed, tmp_path):
    effects = ("bias: 0.1, 0.07, -0.1", *SENSOR[1:]) if changed else SENSOR
    write_document(tmp_path / "a.json", 1)
    write_document(tmp_path / "b.json", 2, effects=effects)
    out = tmp_path / "out"
    told = succeed("compare", tmp_path / "a.json", tmp_path / "b.json", "--out", out).stdout
    content = json.loads((out / "history.json").read_text(encoding="utf-8"))
    assert content["state"] == ("changed" if changed else "unchanged")
    assert (content["test"]["p_value"] < content["test"]["level"]) == changed
    assert [p["name"] for p in content["parameters"] if p["found"]] == ["b_y"] * changed
    assert told.startswith(f"{content['state'].upper()}: {content['verdict']}")
    page = (out / "report.html").read_text(encoding="utf-8")
    assert_sound(page)
    assert "session-1 and session-2 compared" in text_of(page)
    assert (out / "figures/history.svg").is_file()
