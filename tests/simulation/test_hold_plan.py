"""Conditions of the holds, and studies of effects that depend on them."""

import math

import numpy as np
import pytest
from leveling_helpers import leveling_error
from scipy import stats
from study_helpers import NINE, grid, make_cells

from accelstudy.basics.units import MGON, STANDARD_GRAVITY
from accelstudy.leveling.error import cap_forces
from accelstudy.sensors.sensor import SensorModel
from accelstudy.simulation.hold_plan import HoldPlan

FULL = HoldPlan(30.0, (10.0, 40.0), "random", (0.5, 2.0), "random", seed=3)


# --- conditions ----------------------------------------------------------------------------------


def test_what_is_drawn_is_uniform_and_independent():
    n = 5000
    hold = FULL.hold(n)
    assert hold.time.tolist() == [30.0 * i for i in range(n)]
    ranges = {"temperature": (10, 30), "vibration": (0.5, 1.5), "yaw": (-np.pi, 2 * np.pi)}
    for name, (low, width) in ranges.items():
        assert stats.kstest(hold.column(name), stats.uniform(low, width).cdf).pvalue > 1e-4
    drawn = np.stack([hold.column(name) for name in ranges])
    assert np.abs(np.corrcoef(drawn)[np.triu_indices(3, 1)]).max() < 4.5 / math.sqrt(n)
    np.testing.assert_array_equal(FULL.hold(n).yaw, hold.yaw)


# --- leveling ------------------------------------------------------------------------------------


def test_the_rig_stays_behind_when_the_sensor_levels():
    """Neither a tilted base nor what was estimated of it tilts the sensor elsewhere."""
    model = SensorModel.of("m", ["bias", "base_tilt", "gravity_error"])
    forces = cap_forces(0.8, 50)
    truth = np.array([0.01, 0, 0, 1e-3, 2e-3, 1e-3])
    estimates = np.array([[0.01, 0, 0, 5e-3, 0, 7e-3]])
    error = leveling_error(model, truth, model, estimates, forces, hold=FULL.use(forces, 9))
    np.testing.assert_allclose(error.rms, 0, atol=1e-12)


def test_what_depends_on_temperature_tilts_if_it_is_not_estimated():
    """A bias of b (T − 20 °C) on x at T uniform in 10 to 40 °C is a pitch of b (T − 20)/g."""
    simulated = SensorModel.of("t", ["bias", "thermal_bias"])
    estimated = SensorModel.of("b", ["bias"])
    forces = cap_forces(0.01, 20_000)
    truth = np.array([0, 0, 0, 0.01, 0, 0])
    hold = FULL.use(forces, 9)
    error = leveling_error(simulated, truth, estimated, np.zeros((2, 3)), forces, hold=hold)
    mean_square = (20**3 + 10**3) / 3 / 30
    expected = 0.01 / STANDARD_GRAVITY * math.sqrt(mean_square)
    assert error.rms[1] == pytest.approx(expected, rel=0.02)


# --- studies -------------------------------------------------------------------------------------

HOLDS = {
    "interval_s": 60, "temperature_degC": [20, 40], "temperature_order": "random",
    "vibration_mps2": [0, 1], "yaw": "random",
}  # fmt: skip
MINE = ["bias", "scale", "nonorthogonality", "thermal_bias", "warm_up(tau=400)", "base_tilt"]
SENSOR = {
    "thermal_bias": {"value": [1, -1, 2], "unit": "mg/K"},
    "warm_up": {"value": [3, 3, 3], "unit": "mg"},
    "warm_up(tau=400)": {"value": [1, 2, 3], "unit": "mg"},
    "base_tilt": {"value": [20, -20], "unit": "mgon"},
}


def test_cells_know_their_holds():
    cells = make_cells(grid("mine"), models={"mine": MINE}, holds=HOLDS, sensor=SENSOR, seed=8)
    cell = cells["mine/mclaren-24/robot"]
    assert cell.holds == HoldPlan(60.0, (20.0, 40.0), "random", (0.0, 1.0), "random", seed=8)
    assert [cell.truth[f"w_{i}"] for i in "xyz"] == pytest.approx(
        [i * 9.80665e-3 for i in (1, 2, 3)]
    )
    assert cell.truth["tilt_a"] == pytest.approx(20 * MGON)
    plain = make_cells(grid(), seed=8)[f"{NINE}/mclaren-24/robot"]
    other = make_cells(grid(), seed=8, holds=HOLDS)[f"{NINE}/mclaren-24/robot"]
    assert tuple(plain.seed(1, 0).generate_state(2)) != tuple(other.seed(1, 0).generate_state(2))
