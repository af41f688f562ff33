"""Shares of the variance in use: closed forms, and a simulation."""

from dataclasses import replace

import numpy as np
import pytest
from study_helpers import NINE

from accelstudy.basics.units import GON, MGON, STANDARD_GRAVITY
from accelstudy.data_sheets import DataSheet, get_data_sheet
from accelstudy.field.figure import field_figure
from accelstudy.field.shares import Use, field_shares, parts_of_variance, shares_in_use
from accelstudy.leveling.angles import specific_force
from accelstudy.leveling.sensitivity import leveled
from accelstudy.pole.sensor import CalibratedSensor, from_linear_theory
from accelstudy.sensors.models import get_model

SHEET = DataSheet(
    "mine", velocity_random_walk=1e-3, bias_instability=4e-4, acceleration_random_walk=1e-5,
    repeatability=2e-3, bias_per_kelvin=2e-4, scale_per_kelvin=3e-4,
)  # fmt: skip
USE = Use(averaging=4.0, age=3600.0, temperature_change=5.0)


@pytest.fixture(scope="module")
def sensor():
    return from_linear_theory(NINE, "mclaren-24", "gravity", SHEET, 10.0)


@pytest.fixture(scope="module")
def shares(sensor):
    return field_shares(sensor, USE, [0], [0, 30])


def by_source(table):
    return table.groupby(["output", "source"])["shapley_effect"].sum()


def test_shares_at_level_are_the_squares_of_what_the_data_sheet_says(sensor):
    """At level each error of a force counts by 1/g, and none of a scale does."""
    table = shares_in_use(sensor, USE, np.zeros((1, 2)))
    sigma = {
        "noise": SHEET.sigma_mean(4.0),
        "drift": SHEET.bias_change(3600.0),
        "restart": 2e-3,
        "temperature": 1e-3,
    }
    # Linear theory: b_y and α_zx to roll, b_x and α_zy to pitch.
    b, alpha = np.sqrt(np.diag(sensor.covariance))[[0, 7]]
    calibration = b**2 / STANDARD_GRAVITY**2 + alpha**2
    variance = sum(s**2 for s in sigma.values()) / STANDARD_GRAVITY**2 + calibration
    for output in ("roll", "pitch"):
        rows = table[table["output"] == output]
        assert rows["sd_output_mgon"].iloc[0] == pytest.approx(np.sqrt(variance) / MGON, rel=1e-3)
        shares = by_source(table).loc[output]
        assert shares.sum() == pytest.approx(1)
        for source, size in sigma.items():
            expected = (size / STANDARD_GRAVITY) ** 2 / variance
            assert shares[source] == pytest.approx(expected, rel=1e-3)
        scales = rows[rows["input"].str.startswith("s_") & (rows["source"] == "temperature")]
        assert len(scales) == 3
        assert scales["shapley_effect"].max() < 1e-6


def test_a_simulation_has_the_same_variances(sensor):
    """All errors drawn, and each source left out once, through the whole leveling."""
    attitude, n = np.array([40.0, -30.0]) * GON, 40_000
    rng = np.random.default_rng(1)
    f_s = np.array(specific_force(*attitude, STANDARD_GRAVITY))
    sigma = {
        "noise": SHEET.sigma_mean(4.0),
        "drift": SHEET.bias_change(3600.0),
        "restart": 2e-3,
        "temperature": np.hypot(1e-3, 1.5e-3 * f_s),
    }
    drawn = {source: size * rng.standard_normal((n, 3)) for source, size in sigma.items()}
    drawn["calibration"] = rng.multivariate_normal(np.zeros(9), sensor.covariance, n)

    def variances(left_out=None):
        forces = f_s + sum(drawn[source] for source in sigma if source != left_out)
        errors = drawn["calibration"] * (left_out != "calibration")
        angles = leveled(attitude, sensor.model)(np.concatenate([forces, errors], axis=1))
        return angles.var(axis=0)

    table = shares_in_use(sensor, USE, attitude[None])
    whole = variances()
    for k, output in enumerate(("roll", "pitch")):
        sd = table.loc[table["output"] == output, "sd_output_mgon"].iloc[0] * MGON
        assert whole[k] == pytest.approx(sd**2, rel=4.5 * np.sqrt(2 / n))
    for source in drawn:
        gone = 1 - variances(source) / whole
        expected = by_source(table)[:, source][["roll", "pitch"]]
        np.testing.assert_allclose(gone, expected, atol=4.5 * np.sqrt(4 / n))


def test_shares_over_time_and_temperature(shares):
    parts = parts_of_variance(shares)
    time, warmth = (parts.xs(over, level="over") for over in ("time", "temperature"))
    assert (time["temperature"] == 0).all()  # which would hide what time does
    assert time["drift"].is_monotonic_increasing
    for constant in ("calibration", "noise", "restart"):
        np.testing.assert_allclose(parts[constant], parts[constant].iloc[0], rtol=1e-9)
    kelvin = warmth.index.get_level_values("kelvin").to_numpy()
    per_kelvin = warmth["temperature"] / kelvin**2
    np.testing.assert_allclose(per_kelvin, per_kelvin.iloc[0])
    use = shares[(shares["over"] == "use") & (shares["source"] == "calibration")]
    each = use.loc[use["input"] == "b_x", "sd_output_mgon"]  # roll and pitch in two attitudes
    assert len(each) == 4
    assert parts.xs("use", level="over").sum(axis=1).iloc[0] == pytest.approx(np.mean(each**2))


def test_what_was_not_switched_off_and_what_the_calibration_corrects_has_no_share(sensor):
    table = shares_in_use(sensor, replace(USE, restarted=False), np.zeros((1, 2)))
    assert (by_source(table)[:, "restart"] == 0).all()
    model = get_model("bias-scale+thermal_bias")
    u = model.n_parameters
    thermal = CalibratedSensor(model, np.zeros(u), 1e-8 * np.eye(u), SHEET)
    table = shares_in_use(thermal, USE, np.zeros((1, 2)))
    assert (by_source(table)[:, "temperature"] == 0).all()
    effect = table["input"].isin([p.name for p in model.effects[-1].parameters])
    assert table.loc[effect, "shapley_effect"].max() > 0.01  # its own uncertainty, 5 K away


def test_the_figure_says_what_a_data_sheet_does_not(sensor, shares):
    def texts(table, sheet):
        figure = field_figure(table, sheet, USE)
        legend = [text.get_text() for text in figure.legends[0].get_texts()]
        return legend, figure.get_suptitle()

    legend, title = texts(shares, SHEET)
    assert legend[1:] == [
        "calibration", "noise of the reading", "drift since the calibration",
        "switching off and on", "temperature",
    ]  # fmt: skip
    assert title == "mine"
    paper = get_data_sheet("paper")
    nothing = field_shares(replace(sensor, sheet=paper), USE, [0], [0])
    legend, title = texts(nothing, paper)
    assert legend[1:] == ["calibration", "noise of the reading"]
    assert "taken as zero: bias instability, random walk of the bias, repeatability" in title
