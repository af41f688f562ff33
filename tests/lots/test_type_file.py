"""The file of a type: what it tells of the next sensor, for each command that takes it."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import yaml
from calling import refusal, succeed
from campaign_helpers import made

import accelstudy as acs
from accelstudy.approaches import get_approach
from accelstudy.basics.errors import InputError
from accelstudy.campaign.calibration.fit import fit_campaign
from accelstudy.campaign.format import write_campaign
from accelstudy.campaign.sensor_type import SensorType, read_type
from accelstudy.lots.calibration import LotCalibration
from accelstudy.lots.file_format import SensorState
from accelstudy.lots.noise import NoisePrior
from accelstudy.lots.passes import LotEffect
from accelstudy.lots.type_file import write_type
from accelstudy.schemes import get_scheme
from accelstudy.sensors.models import get_model
from accelstudy.simulation.sessions import Noise, session

STANDARD_ERRORS = 3.3
MODEL = get_model("bias-scale-nonorthogonality")
GRAVITY = 9.80665
USUAL = 5e-4
"""SI, the order of the sigmas in 24 positions."""


def measured(scheme, parameters, rng, name="next"):
    directions = get_scheme(scheme).directions
    drawn = session(MODEL, parameters, directions, GRAVITY).draw(Noise(0.002), 1, rng)
    return made(drawn.forces[0], GRAVITY, 0.002, name=name)


def fitted(campaign):
    return fit_campaign(campaign, MODEL, get_approach("gravity"))


def type_of(sensors, folder, effects=()):
    """The file of a type in which no sensor is odd; effects of the lot are in none for sure."""
    fits = {i: fitted(one) for i, one in enumerate(sensors)}
    named = [SimpleNamespace(noise=NoisePrior(0.002, 200.0)) for _ in sensors]
    lot = SimpleNamespace(
        odd={}, last=SimpleNamespace(sensors=named),
        each=[SensorState(campaign=one.name, names=[], posterior=1.0) for one in sensors],
        effects=effects, model=MODEL,
    )  # fmt: skip
    assert write_type(LotCalibration(lot, fits, {}), folder)
    return folder / "type.yaml"


@pytest.mark.parametrize(("scatter", "types"), [(USUAL, 10), (20 * USUAL, 18)])
def test_intervals_with_a_type_hold_the_truth(scatter, types, tmp_path):
    """Four further sensors of each type, in six positions that alone are too few."""
    rng, inside = np.random.default_rng(11), []
    for _ in range(types):
        mean = rng.normal(0, 5e-3, 9)
        draws = mean + scatter * rng.standard_normal((14, 9))
        sensors = [measured("mclaren-24", x, rng, f"s{i}") for i, x in enumerate(draws[:10])]
        of_type = read_type(type_of(sensors, tmp_path), MODEL)
        held = []
        for truth in draws[10:]:
            fit = fitted(replace(measured("faces-6", truth, rng), sensor_type=of_type))
            held.append(abs(fit.parameters - truth) < fit.sigmas_95 * fit.sigma)
        inside.append(np.mean(held))
    # The scatter of a type is taken at its bound: never too certain.
    standard_error = np.std(inside) / np.sqrt(len(inside))
    assert STANDARD_ERRORS * standard_error < 0.065
    assert np.mean(inside) + STANDARD_ERRORS * standard_error > 0.93
    assert np.mean(inside) - STANDARD_ERRORS * standard_error < 0.99


def test_a_type_is_an_observation_of_the_parameters():
    """With a prior the estimate is the weighted mean of the prior and of that without one."""
    rng = np.random.default_rng(12)
    campaign = measured("mclaren-24", np.zeros(9), rng)
    mean, sigma = rng.normal(0, 1e-3, 9), 10 ** rng.uniform(-4, -3, 9)
    known = dict(zip(MODEL.parameter_names, zip(mean, sigma, strict=True), strict=True))
    free, bound = (
        fitted(one) for one in (campaign, replace(campaign, sensor_type=SensorType("t", 9, known)))
    )
    assert bound.solution.redundancy == free.solution.redundancy + 9
    cofactors = np.linalg.inv(np.linalg.inv(free.solution.cofactors) + np.diag(sigma**-2))
    np.testing.assert_allclose(bound.solution.cofactors, cofactors, rtol=2e-2, atol=1e-9)
    right = np.linalg.solve(free.solution.cofactors, free.parameters) + mean / sigma**2
    np.testing.assert_allclose(bound.parameters, cofactors @ right, atol=2e-2 * free.sigma.max())


def test_a_type_tells_nothing_of_the_noise_of_positions():
    """A vague prior changes nothing; six positions leave nothing that tells their noise."""
    rng = np.random.default_rng(16)
    vague = SensorType("t", 9, dict.fromkeys(MODEL.parameter_names, (0.0, 10.0)))
    campaign = measured("mclaren-24", np.zeros(9), rng).with_sigma(None)
    free, bound = fitted(campaign), fitted(replace(campaign, sensor_type=vague))
    assert bound.dof == pytest.approx(free.dof, rel=1e-4)
    np.testing.assert_allclose(bound.sigma, free.sigma, rtol=1e-4)
    few = measured("faces-6", np.zeros(9), rng).with_sigma(None)
    usual = SensorType("t", 9, dict.fromkeys(MODEL.parameter_names, (0.0, 0.1)))
    with pytest.raises(InputError, match="nothing tells the noise of the 6 positions"):
        fitted(replace(few, sensor_type=usual))


@pytest.mark.parametrize("scheme", ["mclaren-24", "faces-6"])
def test_sigmas_contain_that_a_sensor_is_of_another_type(scheme):
    """The positions bear the stated noise, and what is known is refuted."""
    usual = SensorType("t", 9, dict.fromkeys(MODEL.parameter_names, (0.0, 1e-3)))
    other = measured(scheme, np.full(9, 1e-2), np.random.default_rng(17))
    fit = fitted(replace(other, sensor_type=usual))
    assert fit.state == "rejected"
    assert scheme == "faces-6" or fitted(other).global_test.accepted
    assert np.all(np.abs(fit.parameters - 1e-2) < fit.sigmas_95 * fit.sigma)


def test_each_command_takes_a_type(tmp_path):
    made = [acs.simulate_campaign(name=f"s{i}", seed=i, approach="gravity") for i in range(5)]
    write_campaign(made[0], tmp_path / "s0")
    of_type = type_of(made, tmp_path)
    content = yaml.safe_load(of_type.read_text(encoding="utf-8"))
    assert content["sensors"] == 5
    assert list(content["parameters"]) == list(MODEL.parameter_names)
    faces = acs.simulate_campaign(name="faces", seed=9, approach="gravity", scheme="faces-6")
    write_campaign(faces, tmp_path / "faces")
    assert "do not determine" in refusal("calibrate", tmp_path / "faces", "--out", tmp_path / "c")
    given = ("--model", of_type, "--prior", of_type)
    succeed("calibrate", tmp_path / "faces", *given, "--out", tmp_path / "c")
    document = json.loads((tmp_path / "c/calibration.json").read_text(encoding="utf-8"))
    assert document["type"] == {"file": str(of_type), "sensors": 5}
    page = (tmp_path / "c/report.html").read_text(encoding="utf-8")
    assert "5 sensors of its type" in page
    assert "--prior" in page
    succeed("diagnose", tmp_path / "s0", *given, "--out", tmp_path / "d")
    advice = succeed(
        "advise", tmp_path / "faces", "--tilt-accuracy", "100mgon", *given
    ).stdout  # fmt: skip
    assert "faces" in advice
    question = ("--sensor", of_type, "--tilt-accuracy", "100mgon", "--out", tmp_path / "p")
    assert "type" in succeed("plan", *question).stdout  # the name of its data sheet


def test_the_next_sensor_need_not_have_what_no_sensor_has_for_sure(tmp_path):
    rng = np.random.default_rng(15)
    made = [measured("mclaren-24", np.zeros(9), rng, f"s{i}") for i in range(5)]
    scale = LotEffect(("scale",), 0.8, 0.4, (0.1, 0.9), "scale", ("scale",) * 5, *np.zeros((2, 5)))
    read = yaml.safe_load(type_of(made, tmp_path, (scale,)).read_text(encoding="utf-8"))
    sure = {name: one["in_all"] for name, one in read["parameters"].items()}
    assert sure == {name: not name.startswith("s_") for name in MODEL.parameter_names}
    assert all(one["sigma"] > 0 for one in read["parameters"].values())
