"""Lots of simulated sensors by the command, and the mean and scatter of a type."""

import json

import numpy as np
import pytest
from calling import succeed
from page_helpers import assert_sound, text_of

import accelstudy as acs
from accelstudy.approaches import get_approach
from accelstudy.campaign.calibration.fit import fit_campaign
from accelstudy.campaign.format import read_campaign, write_campaign
from accelstudy.campaign.sensor_type import SensorType
from accelstudy.lots.calibration import _squared_error
from accelstudy.lots.evidence import Sensor
from accelstudy.lots.lot import extended
from accelstudy.lots.sizes import LotResiduals
from accelstudy.lots.type_parameter import TypeParameter
from accelstudy.sensors.models import get_model

STANDARD_ERRORS = 3.3
SEED = np.random.SeedSequence(1)


def test_a_campaign_that_does_not_determine_the_model_says_nothing():
    few, one = (
        acs.simulate_campaign(scheme=scheme, temperature=(15, 35))
        for scheme in ("faces-6", "mclaren-24")
    )
    silent = Sensor(few, get_model("bias-scale-nonorthogonality"), get_approach("gravity"), SEED)
    silent = silent.evidence()
    assert (silent.odds, silent.p_value) == ({}, 1.0)
    loud = Sensor(one, get_model("bias-scale"), get_approach("gravity"), SEED).evidence()
    residuals = LotResiduals([silent.frame, loud.frame], [loud.base.level] * 2)
    assert [*residuals.shown("thermal_bias").right.any(axis=1)] == [False, True]


def over_sensors(values, sigmas, odd=()):
    """A parameter over the sensors of a lot, all of which have it."""
    usual = np.isin(np.arange(len(values)), odd, invert=True)
    return TypeParameter("b_x", "m/s^2", True, values, sigmas, usual, np.ones_like(usual))


def test_the_scatter_of_a_type_is_found():
    """Mean and scatter of many sensors with known ones, beside an odd one, and of a single one."""
    rng = np.random.default_rng(6)
    sigmas = rng.uniform(0.5, 1.5, 2000)
    values = 3 + rng.normal(0, 0.8, 2000) + sigmas * rng.standard_normal(2000)
    values[7] = 1e6
    many = over_sensors(values, sigmas, [7])
    low, high = many.scatter_ci95
    assert low < many.scatter < high
    assert many.mean == pytest.approx(3, abs=STANDARD_ERRORS * many.sigma)
    assert many.scatter == pytest.approx(0.8, abs=0.1)
    one = over_sensors(np.array([2.0, np.nan]), np.array([0.5, 0.5]))
    assert (one.mean, one.scatter, one.sigma) == (2.0, 0.0, 0.5)
    assert one.scatter_ci95 == (0.0, np.inf)
    assert np.isnan(over_sensors(np.full(3, np.nan), np.full(3, np.nan)).mean)


def test_the_tilt_error_without_an_effect_is_that_of_sensors_without_noise():
    """Sensors whose coefficients are those of a type, with noise that hides them, and without."""
    rng, base = np.random.default_rng(4), get_model("bias-scale-nonorthogonality")
    whole = extended(base, ["thermal_bias"])
    squares = np.empty((2, 30, 2))
    for i in range(squares.shape[1]):
        own = ", ".join(f"{size:.9f}" for size in rng.normal(3e-4, 1e-4, 3))
        for k, (sigma, spread) in enumerate([("4 mm/s^2", 1e-4), ("1e-4 mm/s^2", 1.0)]):
            campaign = acs.simulate_campaign(
                seed=i, scheme="fibonacci-18", sigma=sigma, approach="gravity",
                temperature=(5, 35), temperature_order="random", effects=(f"thermal_bias: {own}",),
            )  # fmt: skip
            known = SensorType("", 30, {f"b_T_{axis}": (3e-4, spread) for axis in "xyz"})
            squares[k, i] = _squared_error(fit_campaign(campaign, whole), base, known)
    told, true = squares
    assert told.min() > 0
    error = (told - true).std(axis=0) / np.sqrt(len(told))
    assert np.all(np.abs((told - true).mean(axis=0)) < STANDARD_ERRORS * error)
    assert np.all(error < 0.15 * true.mean(axis=0))


N_LOT = 6


@pytest.mark.usefixtures("composed")
def test_the_command_says_what_a_lot_lacks(tmp_path):
    """Sensors with a thermal bias, one that has something else, and two that do not count.

    The draws begin with the seed zero, and the mean of the sensors has some of its own. Campaigns
    of one name get their numbers behind it.
    """
    for i in range(N_LOT):
        effect = "quadratic_scale" if i == N_LOT - 1 else "thermal_bias: 0.0003, -0.0003, 0.0003"
        one = acs.simulate_campaign(
            name=f"sensor-{i}", seed=i, effects=(effect,), temperature=(15, 35),
            temperature_order="random",
        )  # fmt: skip
        write_campaign(one, tmp_path / f"sensor-{i}")
    folders = sorted(tmp_path.glob("sensor-*"))
    few = acs.simulate_campaign(name="few", scheme="faces-6", approach="gravity")
    write_campaign(few, tmp_path / "few")
    write_campaign(read_campaign(folders[0]), tmp_path / "copy")
    given = [*folders, tmp_path / "few", tmp_path / "copy"]
    told = succeed("lot", *given, "--seed", 0, "--out", tmp_path / "lot").stdout
    content = json.loads((tmp_path / "lot/lot.json").read_text(encoding="utf-8"))
    left_out = {left["campaign"]: left["reason"] for left in content["left_out"]}
    assert left_out.keys() == {"few", "sensor-0-8"}
    assert "do not determine" in left_out["few"]
    assert "has the readings of sensor-0-1" in left_out["sensor-0-8"]
    assert content["sensors"] == N_LOT
    assert content["anything"]["missing"]
    (effect,) = content["effects"]
    assert effect["names"][0] == "thermal_bias"
    assert effect["share_ci95"][0] < 1 - 1 / N_LOT < effect["share_ci95"][1]
    assert [o["campaign"] for o in content["odd"]] == [f"sensor-{N_LOT - 1}"]
    assert [e["names"] for e in content["each"]] == [*[["thermal_bias"]] * (N_LOT - 1), ["odd"]]
    for parameter, true in zip(effect["parameters"], (3e-4, -3e-4, 3e-4), strict=True):
        assert parameter["mean"] == pytest.approx(true, abs=4 * parameter["sigma"])
    assert content["verdict"] in told
    page = (tmp_path / "lot/report.html").read_text(encoding="utf-8")
    assert_sound(page)
    assert f"A lot of {N_LOT} sensors" in text_of(page)
    assert "odd: quadratic scale" in text_of(page)
    each = sorted(path.name for path in (tmp_path / "lot/each").iterdir())
    assert each[1:] == [f"{i + 1:04d}-sensor-{i}" for i in range(1, N_LOT)]
    file = tmp_path / "lot/each" / each[0] / "calibration.json"
    calibrated = json.loads(file.read_text(encoding="utf-8"))
    assert "b_T_x" in {p["name"] for p in calibrated["parameters"]}
    model = tmp_path / "lot/type.yaml"
    said = succeed("calibrate", folders[0], "--model", model, "--out", tmp_path / "c").stdout
    assert "ACCEPTED" in said
    assert "b_T_x" in said


@pytest.mark.usefixtures("composed")
def test_what_names_explain_only_in_part_leaves_the_model_as_it_was(tmp_path):
    """A thermal bias, and a pattern in common that nothing explains, at two temperatures.

    Beside the thermal bias these do not determine the curve that comes closest to the pattern.
    """
    campaigns, pattern = list[acs.Campaign](), np.random.default_rng(9).normal(0, 0.002, (18, 3))
    warm = np.random.default_rng(1).permutation(18) % 2
    for i in range(4):
        one = acs.simulate_campaign(
            name=f"sensor-{i}", seed=i, scheme="fibonacci-18", sigma="1 mm/s^2", approach="gravity"
        )
        forces = one.forces + pattern + np.outer(30 * warm - 15, (3e-3, -3e-3, 3e-3))
        campaigns.append(one.with_arrays(forces=forces, temperature=5.0 + 30 * warm))
    lot = acs.lot(campaigns)
    assert lot.state == "unknown"
    assert lot.content["close"] == [["thermal_bias"]]
    lot.save(tmp_path / "lot")
    for calibration in lot.calibrations.values():
        assert calibration.fit.model.name == "bias-scale-nonorthogonality"
