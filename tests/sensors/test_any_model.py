"""Compositions in all that takes a model: commands, studies, batches and the round trip."""

import json
from functools import cache, partial

import gross
import numpy as np
import pandas as pd
import pytest
from calling import call, succeed

import accelstudy as acs
from accelstudy.approaches import get_approach
from accelstudy.campaign.calibration.document import calibration_document
from accelstudy.campaign.calibration.export import export
from accelstudy.campaign.calibration.fit import fit_campaign
from accelstudy.campaign.calibration.sensor_calibration import read_calibration
from accelstudy.diagnosis.pipeline import diagnose
from accelstudy.diagnosis.report.output import Diagnosis
from accelstudy.sensors.frames import parse_frame
from accelstudy.sensors.models import get_model

NINE = "bias-scale-nonorthogonality"


TURNED = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]


def run(*arguments):
    return succeed(*arguments).output


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A campaign of a sensor that warms up and whose bias follows the temperature."""
    folder = tmp_path_factory.mktemp("any-model")
    run(
        "simulate-campaign", "--out", folder / "c", "--truth", folder / "truth.yaml", "--seed", "4",
        "--scheme", "fibonacci-30", "--order", "random", "--temperature", "15:40",
        "--temperature-order", "ABBA", "--model", f"{NINE}+warm_up(tau=400)",
        "--effect", "thermal_bias",
    )  # fmt: skip
    return folder


def parameters(path):
    document = json.loads(path.read_text(encoding="utf-8"))
    return {p["name"]: (p["value"], p["sigma"]) for p in document["parameters"]}


# --- what a diagnosis found, used the next day ----------------------------------------------------


@pytest.fixture(scope="module")
def diagnosed(made):
    """Folder of the diagnosis of the campaign, which lacks both effects."""
    run("diagnose", made / "c", "--out", made / "d")
    return made / "d"


def test_a_diagnosis_writes_the_calibration_of_what_it_found(made, diagnosed):
    found = parameters(diagnosed / "calibration.json")
    run("calibrate", made / "c", "--model", diagnosed / "model.yaml", "--approach", "robot",
        "--out", made / "again")  # fmt: skip
    again = parameters(made / "again/calibration.json")
    assert list(found) == list(again)
    for name, (value, sigma) in found.items():
        assert again[name][0] == pytest.approx(value, abs=1e-6 * sigma)
        # The diagnosis searched for the settings, which the model states.
        assert again[name][1] <= sigma * (1 + 1e-6)
    assert {"b_T_z", "w_z"} < set(found)
    effects = json.loads((diagnosed / "diagnosis.json").read_text(encoding="utf-8"))["effects"]
    for entry in (p for effect in effects for p in effect["parameters"]):
        assert found[entry["name"]] == pytest.approx((entry["value"], entry["sigma"]))


@cache
def calibration_of(wrong=lambda campaign: campaign, **settings):
    """A campaign, its diagnosis, and the calibration that this writes."""
    campaign = wrong(acs.simulate_campaign(scheme="fibonacci-30", **settings))
    diagnosis = diagnose(campaign, get_model(NINE))
    return campaign, diagnosis, Diagnosis(diagnosis).calibration.content


IN_G = partial(gross.unit, force=1 / 9.80665)


@pytest.mark.parametrize(("wrong", "words", "turned"), [
    (partial(gross.axes, x=-2, y=1, z=3), "axes are swapped: x is read as y, y is read as −x",
     True),
    (IN_G, "the forces are in g", True),
    (partial(gross.unit, angle=0.9), "the robot's angles are in degrees", False),
], ids=["axes", "g", "degrees"])  # fmt: skip
def test_a_calibration_of_mended_data_says_so(wrong, words, turned):
    whole = calibration_of()[2]
    assert whole["mended"] is None
    campaign, diagnosis, content = calibration_of(wrong)
    assert (content["mended"]["reason"], whole["warnings"]) == (words, [])
    assert words in content["warnings"][0]
    for ours, right in zip(content["parameters"], whole["parameters"], strict=True):
        assert ours["value"] == pytest.approx(right["value"], abs=1e-6)
    matrix = content["mended"]["matrix"] if turned else np.eye(3)
    np.testing.assert_allclose(campaign.forces @ np.transpose(matrix), diagnosis.campaign.forces)
    assert (content["mended"]["matrix"] is not None) == turned


def test_a_calibration_with_the_noise_that_was_found():
    _, diagnosis, content = calibration_of(noise_effects=("noise_level(kappa=3)",))
    assert diagnosis.verdict == "noise_model"
    assert content["sigma_source"] == "a posteriori"
    sigmas = diagnosis.final.residuals.sigmas[:, :3]
    expected = np.sqrt(diagnosis.noise.variance) * np.mean(sigmas)
    assert content["sigma_position_mps2"] == pytest.approx(expected)


@pytest.mark.parametrize("frame", ["frd", "flu", "rfu"])
def test_forms_take_and_give_the_axes_of_the_log(frame, tmp_path):
    """With data of a campaign whose axes were mended, in counts of a log with axes of its own."""
    scale, offset = [0.02, 0.021, 0.019], [500, 510, 490]
    log = {"unit": "counts", "scale": scale, "offset": offset, "frame": frame}
    mended = {"error": "axis_error", "reason": "x is read as −y", "matrix": TURNED}
    path = tmp_path / "calibration.json"
    path.write_text(
        json.dumps({**calibration_of()[2], "log": log, "mended": mended}), encoding="utf-8"
    )
    calibration = read_calibration(path)
    raw = np.random.default_rng(2).normal(500, 300, (6, 3))
    axes = parse_frame(frame)
    forces = axes.to_frd((raw - offset) * scale) @ np.transpose(TURNED)
    expected = axes.from_frd(calibration.correct(forces))
    result = call("export", path, "--form", "matrix")
    assert result.stderr == "warning: the calibration is of mended data: x is read as −y\n"
    matrix = np.array([row.split() for row in result.stdout.splitlines()], float)
    np.testing.assert_allclose(raw @ matrix[:, :3].T + matrix[:, 3], expected, atol=1e-8)
    assert "x is read as −y" in succeed("export", path, "--form", "c").stdout


CALIBRATED = [f"f{axis}_calibrated_mps2" for axis in "xyz"]


def log_of(forces, folder):
    path = folder / "log.csv"
    pd.DataFrame(forces, columns=["fx", "fy", "fz"]).to_csv(path, index=False)
    return path


def test_apply_mends_readings_as_the_data_were(tmp_path):
    campaign, _, content = calibration_of(IN_G)
    path = tmp_path / "calibration.json"
    path.write_text(json.dumps(content), encoding="utf-8")
    log, right = log_of(campaign.forces, tmp_path), read_calibration(path)
    expected = right.correct(campaign.forces * 9.80665)
    for options, words in (
        ([], "the forces are in g; readings are mended in the same way"),
        (["--unit", "g"], "the forces are in g; readings are converted by the options only"),
    ):
        arguments = ["apply", path, log, "--columns", "fx=0,fy=1,fz=2", *options]
        result = succeed(*arguments, "--out", tmp_path / "out.csv", "--force")
        assert f"warning: the calibration is of mended data: {words}" in result.stderr
        leveled = pd.read_csv(tmp_path / "out.csv")
        np.testing.assert_allclose(leveled[CALIBRATED], expected, atol=1e-5)


def test_the_rig_stays_where_it_was(tmp_path):
    """What belongs to the rig is in no matrix."""
    campaign = acs.simulate_campaign(scheme="fibonacci-30", order="random")
    model = get_model("bias+encoder_scale+scale+nonorthogonality")
    fit = fit_campaign(campaign, model, get_approach("robot"))
    content = calibration_document(fit)
    path = tmp_path / "calibration.json"
    path.write_text(json.dumps(content), encoding="utf-8")
    sensor = np.delete(np.arange(11), [3, 4])
    np.testing.assert_allclose(
        read_calibration(path).covariance, fit.covariance[np.ix_(sensor, sensor)], rtol=1e-12
    )
    assert content["affine"] is not None
    assert len(export(read_calibration(path), "matrix")[0].splitlines()) == 3


def test_a_large_effect_is_fitted_from_the_affine_part_on():
    """From the start of a sensor without it the adjustment does not converge."""
    campaign = acs.simulate_campaign(
        scheme="mclaren-24", approach="gravity", seed=2,
        effects=("saturation(knee=9): 0.5, -0.5, -0.5",),
    )  # fmt: skip
    fit = fit_campaign(campaign, get_model(f"{NINE}+saturation(knee=9)"), get_approach("gravity"))
    assert np.all(abs(fit.parameters[9:] - [0.5, -0.5, -0.5]) < 4 * fit.sigma[9:])
