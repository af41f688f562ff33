"""The example of a pole: geometry, closed forms, and a Monte Carlo of the whole."""

import importlib.util
from dataclasses import replace

import numpy as np
import pytest
from places import ROOT
from scipy.spatial.transform import Rotation
from usual import NINE

from accelstudy.approaches import get_approach
from accelstudy.basics.units import GON, MGON, STANDARD_GRAVITY
from accelstudy.campaign.calibration.file_format import CalibrationDocument
from accelstudy.campaign.calibration.sensor_calibration import SensorCalibration
from accelstudy.data_sheets import DataSheet
from accelstudy.design.estimability import estimability
from accelstudy.schemes import get_scheme
from accelstudy.simulation.sessions import Noise

SHEET = DataSheet(
    "test", velocity_random_walk=2e-3, bias_instability=1e-3, bias_per_kelvin=2e-4,
    scale_per_kelvin=1e-4, repeatability=3e-3,
)  # fmt: skip


@pytest.fixture(scope="module")
def pole():
    spec = importlib.util.spec_from_file_location("pole_example", ROOT / "examples/pole/pole.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def calibrated(**parameters):
    """A calibration in McLaren's positions, predicted by linear theory."""
    noise = Noise(sigma_force=SHEET.sigma_mean(10.0))
    found = estimability(get_scheme("mclaren-24"), NINE, get_approach("gravity"), noise)
    document = CalibrationDocument.model_construct(gravity_mps2=STANDARD_GRAVITY)
    return SensorCalibration(document, NINE, NINE.vector(parameters), found.cofactors)


def test_the_foot_is_where_rotations_put_it(pole):
    values = np.random.default_rng(1).uniform(-0.7, 0.7, len(pole.INPUTS))
    given = dict(zip(pole.INPUTS, values, strict=True))
    body = Rotation.from_euler("ZYX", [given["yaw"], given["pitch"], given["roll"]])
    bore = Rotation.from_euler("YX", [given["mounting_right"], given["mounting_forward"]])
    arm = [given["bend_forward"], given["bend_right"], given["length"]]
    expected = values[:3] + body.apply(bore.apply(arm))
    np.testing.assert_allclose(pole.foot(values), expected, atol=1e-14)


def bent_pole(setup, tilt):
    """Foot that is computed less the true one, along the lean and down, m, by integration."""
    x = np.linspace(0, setup.length, 40001)
    head, metre = (
        mass * STANDARD_GRAVITY * np.sin(tilt) for mass in (setup.head_mass, setup.pole_mass)
    )
    moment = head * (setup.length - x) + metre * (setup.length - x) ** 2 / 2
    moment -= moment[0] * np.clip(1 - x / setup.hand_height, 0, None)
    slope = np.concatenate([[0], np.cumsum((moment[1:] + moment[:-1]) / 2)]) * x[1]
    slope /= setup.stiffness
    sag = np.concatenate([[0], np.cumsum((slope[1:] + slope[:-1]) / 2)]) * x[1]
    along, across = np.array([np.sin(tilt), -np.cos(tilt)]), np.array([np.cos(tilt), np.sin(tilt)])
    top = along * setup.length + across * sag[-1]  # sags towards the lean, and down
    at = np.interp(setup.sensor_height, x, slope)
    return top - setup.length * (along + across * at)


@pytest.mark.parametrize("heights", [(2.0, 1.2), (1.0, 1.2), (1.5, 0.5), (0.3, 2.0)])
def test_bending_is_that_of_a_beam(pole, heights):
    setup, tilt = pole.Pole(sensor_height=heights[0], hand_height=heights[1]), 40 * GON
    squares = pole.mean_squares(pole.situation_at(setup, calibrated(), SHEET, tilt))["bending"]
    along, below = bent_pole(setup, tilt)
    np.testing.assert_allclose(np.sqrt(squares[:, :2].sum(axis=1)), abs(along), rtol=1e-4)
    np.testing.assert_allclose(np.sqrt(squares[:, 2]), abs(below), rtol=1e-4)


@pytest.mark.parametrize("tilt", np.array([10.0, 30.0, 50.0]) * GON)
def test_the_budget_agrees_with_the_exact_geometry(pole, tilt):
    """No derivative anywhere; with parameters that are far from zero."""
    setup = replace(pole.Pole(), top_sigma=2e-3, sensor_height=1.5)
    calibration = calibrated(b_x=0.2, b_z=-0.3, s_y=0.01, alpha_zx=500 * MGON)
    table = pole.budget(setup, calibration, SHEET, [tilt]).set_index("source")
    errors = pole.simulate(setup, calibration, SHEET, tilt, 1000, 5)
    for column, squares in (
        ("horizontal", np.sum(errors[..., :2] ** 2, axis=-1)), ("down", errors[..., 2] ** 2),
    ):  # fmt: skip
        # Directions differ systematically, so the variance is taken within each.
        error = np.sqrt(np.mean(np.var(squares, axis=0, ddof=1)) / squares.size)
        assert abs(np.mean(squares) - table.loc["all together", column] ** 2) < 4.5 * error
