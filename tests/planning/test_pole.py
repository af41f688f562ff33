"""The foot of a pole: geometry, closed forms, and a Monte Carlo of the whole."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import ncx2

from accelstudy.basics.units import GON, MGON, STANDARD_GRAVITY
from accelstudy.data_sheets import DataSheet
from accelstudy.leveling.angles import roll_pitch
from accelstudy.pole.budget import TOTAL, budget, contribution, radius, situation_at
from accelstudy.pole.geometry import INPUTS, Situation, foot, jacobian, leaning
from accelstudy.pole.sensor import CalibratedSensor, from_linear_theory, from_tilt_sigma
from accelstudy.pole.setup import Setup, setup_of
from accelstudy.pole.simulation import draw, simulate
from accelstudy.pole.sources import flexibility, sources
from accelstudy.pole.statement import agreement, limits, remarks
from accelstudy.sensors.frames import parse_frame
from accelstudy.sensors.models import get_model

NINE = "bias-scale-nonorthogonality"
SHEET = DataSheet(
    "test", velocity_random_walk=2e-3, bias_instability=1e-3, bias_per_kelvin=2e-4,
    scale_per_kelvin=1e-4, repeatability=3e-3,
)  # fmt: skip
TILTS = np.array([0.0, 10.0, 30.0, 50.0]) * GON


@pytest.fixture(scope="module")
def sensor():
    return from_linear_theory(NINE, "mclaren-24", "gravity", SHEET, 10.0)


def point(**values):
    """Inputs of `foot`, zero but for those that are given."""
    return np.array([values.get(name, 0.0) for name in INPUTS])


def of(name, sensor, tilts=TILTS, **given):
    """What one source contributes, tilts by directions, m: horizontal and vertical."""
    situation = situation_at(Setup(**given), sensor, np.asarray(tilts))
    (source,) = (each for each in sources() if each.name == name)
    part = contribution(source, situation)
    shape = (len(tilts), -1)
    return part.horizontal.reshape(shape), part.vertical.reshape(shape)


# --- geometry ------------------------------------------------------------------------------------


def test_the_foot_is_where_rotations_put_it():
    values = np.random.default_rng(1).uniform(-0.7, 0.7, len(INPUTS))
    given = dict(zip(INPUTS, values, strict=True))
    body = Rotation.from_euler("ZYX", [given["yaw"], given["pitch"], given["roll"]])
    bore = Rotation.from_euler("YX", [given["mounting_right"], given["mounting_forward"]])
    arm = [
        given["bend_forward"] - given["offset_forward"],
        given["bend_right"] - given["offset_right"],
        given["length"],
    ]
    expected = values[:3] + body.apply(bore.apply(arm))
    np.testing.assert_allclose(foot(values), expected, atol=1e-14)


def test_the_jacobian_is_that_of_the_foot():
    values = np.random.default_rng(2).uniform(-0.5, 0.5, len(INPUTS)) + point(length=2.0)
    step = 1e-6
    columns = [
        (np.array(foot(values + step * unit)) - foot(values - step * unit)) / (2 * step)
        for unit in np.eye(len(INPUTS))
    ]
    np.testing.assert_allclose(jacobian(values), np.transpose(columns), atol=1e-9)


def test_a_pole_leans_where_it_is_said_to():
    for direction, (north, east) in ((0.0, (-1, 0)), (np.pi / 2, (0, -1)), (np.pi, (1, 0))):
        roll, pitch = roll_pitch(tuple(leaning(30 * GON, direction)))
        placed = foot(point(length=2.0, roll=roll, pitch=pitch))
        reach = 2 * np.sin(30 * GON)
        expected = [reach * north, reach * east, 2 * np.cos(30 * GON)]
        np.testing.assert_allclose(placed, expected, atol=1e-12)


def test_an_upright_pole_needs_no_heading_and_its_height_no_roll_and_pitch():
    slope = jacobian(point(length=2.0))
    assert np.all(slope[:, INPUTS.index("yaw")] == 0)
    assert np.all(slope[2, [INPUTS.index("roll"), INPUTS.index("pitch")]] == 0)
    small = foot(point(length=2.0, roll=1e-3))
    assert 2.0 - small[2] == pytest.approx(2.0 * 1e-3**2 / 2, rel=1e-6)


def test_an_antenna_beside_the_axis_needs_a_heading_even_upright():
    slope = jacobian(point(length=2.0, offset_forward=0.03, offset_right=0.04))
    assert np.linalg.norm(slope[:, INPUTS.index("yaw")]) == pytest.approx(0.05)


# --- bending -------------------------------------------------------------------------------------


def bent_pole(setup, tilt):
    """Foot that is computed less the true one, along the lean and down, m, by integration."""
    x = np.linspace(0, setup.length, 40001)
    head, metre = (
        mass * STANDARD_GRAVITY * np.sin(tilt) for mass in (setup.head_mass, setup.pole_mass)
    )
    moment = head * (setup.length - x) + metre * (setup.length - x) ** 2 / 2
    if setup.hand_at > 0:
        moment -= moment[0] * np.clip(1 - x / setup.hand_at, 0, None)
    slope = np.concatenate([[0], np.cumsum((moment[1:] + moment[:-1]) / 2)]) * x[1]
    slope /= setup.stiffness
    sag = np.concatenate([[0], np.cumsum((slope[1:] + slope[:-1]) / 2)]) * x[1]
    along, across = np.array([np.sin(tilt), -np.cos(tilt)]), np.array([np.cos(tilt), np.sin(tilt)])
    top = along * setup.length + across * sag[-1]  # sags towards the lean, and down
    at = np.interp(setup.sensor_at, x, slope)
    return top - setup.length * (along + across * at)


@pytest.mark.parametrize("heights", [(2.0, 1.2), (2.0, 0.0), (1.0, 1.2), (1.5, 0.5), (0.3, 2.0)])
def test_bending_is_that_of_a_beam(heights, sensor):
    setup = Setup(sensor_height=heights[0], hand_height=heights[1])
    tilt = 40 * GON
    situation = Situation(setup, sensor, np.array([tilt]), np.array([0.0]))
    (source,) = (each for each in sources() if each.name == "bending")
    north, east, down = contribution(source, situation).shift[0]
    np.testing.assert_allclose([north, down], bent_pole(setup, tilt), rtol=1e-4)
    assert east == 0


def test_a_pole_that_is_clamped_at_its_foot_is_a_cantilever():
    setup = Setup(hand_height=0.0)
    head, metre = setup.head_mass * STANDARD_GRAVITY, setup.pole_mass * STANDARD_GRAVITY
    expected = (head * 2.0**3 / 6 + metre * 2.0**4 / 24) / setup.stiffness
    assert flexibility(setup) == pytest.approx(expected)


# --- sources -------------------------------------------------------------------------------------

# Closed forms for a sensor whose axes are those of the pole (frd), an antenna on the pole's axis,
# and small errors: horizontal and vertical, m. A pole of length L leans by τ in the direction α,
# counted from forward towards right.


def force_error(length, tilt, direction, sigma, g):
    """Errors of a force, equal on all axes (noise, drift): horizontal and vertical, m.

    The horizontal variance is (L σ/g)² {cos²τ + [cos²τ + sin⁴τ sin²α cos²α] / (1 − sin²τ cos²α)²}
    and the vertical one (L σ/g)² sin²τ. The expression in braces is 2 at level, cos²τ + 1/cos²τ for
    a pole that leans forward, and 2 cos²τ for one that leans to the side. They differ since the
    heading is that of the forward axis: if this axis points up or down, an error of roll turns the
    lean about the vertical.
    """
    s, c = np.sin(tilt), np.cos(tilt)
    across = s**2 * np.sin(direction) * np.cos(direction)
    level = 1 - s**2 * np.cos(direction) ** 2
    size = length * sigma / g
    return size * np.sqrt(c**2 + (c**2 + across**2) / level**2), size * s


def mounting_error(length, tilt, sigma):
    """Angles between sensor and pole: L σ √(1 + cos²τ) horizontally, L σ sin τ in height, m."""
    return length * sigma * np.sqrt(1 + np.cos(tilt) ** 2), length * sigma * np.sin(tilt)


def heading_error(length, tilt, sigma):
    """Error of the heading: L sin τ σ horizontally, nothing in height, m."""
    return length * np.sin(tilt) * sigma, 0.0


def length_error(tilt, sigma):
    """Error of the length: σ sin τ horizontally, σ cos τ in height, m."""
    return sigma * np.sin(tilt), sigma * np.cos(tilt)


def bending_error(flexibility, tilt):
    """Bending of a pole: f sin τ cos τ horizontally, f sin²τ in height, m."""
    return abs(flexibility) * np.sin(tilt) * np.cos(tilt), abs(flexibility) * np.sin(tilt) ** 2


def test_each_source_has_its_closed_form(sensor):
    setup = Setup()
    g, around = sensor.gravity, np.arange(16) * np.pi / 8
    noise, drift = SHEET.sigma_mean(setup.averaging), SHEET.bias_change(setup.age, restarted=True)
    for i, tilt in enumerate(TILTS):
        expected = {
            "noise": [force_error(2.0, tilt, a, noise, g) for a in around],
            "drift": [force_error(2.0, tilt, a, drift, g) for a in around],
            "mounting": mounting_error(2.0, tilt, setup.mounting_sigma),
            "heading": heading_error(2.0, tilt, setup.heading_sigma),
            "length": length_error(tilt, setup.length_sigma),
            "bending": bending_error(flexibility(setup, g), tilt),
            "top": (setup.top_sigma, setup.top_sigma_vertical),
        }
        for name, pair in expected.items():
            wanted = np.broadcast_to(pair, (16, 2)).T
            got = [part[i] for part in of(name, sensor)]
            np.testing.assert_allclose(got, wanted, rtol=1e-9, atol=1e-12, err_msg=name)


def test_errors_of_the_angles_grow_with_the_length_and_others_do_not(sensor):
    for name in ("calibration", "noise", "drift", "temperature", "mounting", "heading"):
        for one, two in zip(of(name, sensor), of(name, sensor, length=4.0), strict=True):
            np.testing.assert_allclose(two, 2 * one, rtol=1e-9, atol=1e-14)
    for name in ("top", "length"):
        np.testing.assert_allclose(of(name, sensor)[0], of(name, sensor, length=4.0)[0], rtol=1e-9)


def test_correlated_parameters_count_with_their_covariance(sensor):
    """Only a bias of x and a scale of x that cancel where the pole leans forward by 30 gon."""
    model = get_model(NINE)
    force = leaning(30 * GON, 0.0)[0]
    direction = model.vector({"b_x": 1.0, "s_x": -1.0 / force})
    cancelling = replace(sensor, covariance=1e-6 * np.outer(direction, direction))
    forgetting = replace(sensor, covariance=np.diag(np.diag(cancelling.covariance)))
    assert of("calibration", cancelling, TILTS[2:3])[0][0, 0] < 1e-11
    assert of("calibration", forgetting, TILTS[2:3])[0][0, 0] > 1e-5


def test_the_mounting_says_which_axis_counts(sensor):
    model = get_model(NINE)
    bias_z = model.vector({"b_z": 1e-2})
    upright = replace(sensor, covariance=np.outer(bias_z, bias_z))
    assert of("calibration", upright, [0.0])[0].max() < 1e-12
    lying = replace(upright, mounting=parse_frame("dfr"))
    expected = 2.0 * 1e-2 / STANDARD_GRAVITY
    np.testing.assert_allclose(of("calibration", lying, [0.0])[0], expected, rtol=1e-9)


def test_a_calibration_that_knows_the_temperature_corrects_it(sensor):
    assert of("temperature", sensor)[0].min() > 0
    model = get_model("bias+thermal_bias(tau=300)")
    covariance = np.diag([0.0, 0.0, 0.0, 1e-8, 1e-8, 1e-8])
    thermal = CalibratedSensor(model, np.zeros(6), covariance, SHEET)
    assert thermal.corrected == ("bias",)
    bias_only = replace(thermal, sheet=replace(SHEET, scale_per_kelvin=None))
    assert of("temperature", bias_only)[0].max() == 0
    assert of("temperature", thermal)[0][3].min() > 0  # it does not know of the scales
    # What the sigma of its coefficients leaves grows with the temperature.
    left = of("calibration", thermal, [0.0])[0]
    expected = 2.0 * np.sqrt(2) * 1e-4 * 10.0 / STANDARD_GRAVITY
    np.testing.assert_allclose(left, expected, rtol=1e-9)
    assert any(
        "the change of the bias with temperature; it is" in remark
        for remark in remarks(budget(Setup(), thermal, TILTS))
    )


def test_beyond_a_knee_noise_counts_more_and_a_change_of_bias_as_before(sensor):
    """A pole leans forward by 50 gon: x feels 6.9 m/s², with half the gain left, y nothing."""
    tilt, model, half = 50 * GON, get_model("saturation(knee=6)"), np.full(3, 0.5)
    ideal = replace(sensor, model=model, parameters=np.zeros(3), covariance=np.zeros((3, 3)))
    clipping = replace(ideal, parameters=half)
    setup, given = Setup(age=1.0, temperature_change=20.0), {"age": 1.0, "temperature_change": 20.0}
    for name in ("drift", "temperature"):  # before the sensor clips
        np.testing.assert_allclose(
            of(name, clipping, [tilt], **given), of(name, ideal, [tilt], **given), rtol=1e-6
        )
    c, sigma = np.cos(tilt), SHEET.sigma_mean(setup.averaging)
    expected = setup.length * sigma / STANDARD_GRAVITY * np.sqrt((2 * c) ** 2 + 1 / c**2)
    (horizontal,), _ = of("noise", clipping, [tilt])
    assert horizontal[0] == pytest.approx(expected, rel=1e-6)
    for _, row in simulate(setup, clipping, np.array([tilt]), 400, 5).iterrows():
        assert_within_chance(row)


@pytest.mark.parametrize("direction", [0.0, 0.7, np.pi / 2])
def test_sigmas_of_roll_and_pitch_may_be_given_instead(direction):
    given = from_tilt_sigma(10 * MGON, SHEET)
    tilt = 40 * GON
    situation = Situation(Setup(), given, np.array([tilt]), np.array([direction]))
    part = contribution(sources()[0], situation)
    roll, pitch = (float(angle) for angle in roll_pitch(tuple(leaning(tilt, direction))))
    # Roll moves the foot across forward, and pitch forward: by the rotations of the attitude.
    by_roll = np.array([np.sin(pitch) * np.sin(roll), np.cos(roll), np.cos(pitch) * np.sin(roll)])
    by_pitch = np.array([np.cos(pitch) * np.cos(roll), 0.0, np.sin(pitch) * np.cos(roll)])
    expected = (2.0 * 10 * MGON) ** 2 * (by_roll**2 + by_pitch**2)
    np.testing.assert_allclose(part.squares[0], expected, rtol=1e-9, atol=1e-20)


# --- circles -------------------------------------------------------------------------------------


def test_the_radius_is_that_of_known_distributions():
    round_, line = np.eye(2), np.diag([1.0, 0.0])
    assert radius(round_, np.zeros(2)) == pytest.approx(np.sqrt(-2 * np.log(0.05)), rel=1e-6)
    assert radius(line, np.zeros(2)) == pytest.approx(1.959964, rel=1e-4)
    for shift in ([3.0, 0.0], [12.0, 5.0], [600.0, 800.0]):
        expected = np.sqrt(ncx2.ppf(0.95, 2, np.dot(shift, shift)))
        assert radius(round_, np.array(shift)) == pytest.approx(expected, rel=1e-5)
    assert radius(np.zeros((2, 2)), np.array([3.0, 4.0])) == pytest.approx(5.0, rel=1e-4)


def test_the_radius_holds_its_share_of_an_ellipse_that_lies_aside():
    covariance, shift = np.array([[4.0, 1.5], [1.5, 1.0]]), np.array([1.0, -2.0])
    drawn = np.random.default_rng(3).multivariate_normal(shift, covariance, 200_000)
    inside = np.mean(np.linalg.norm(drawn, axis=1) < radius(covariance, shift))
    assert abs(inside - 0.95) < 4 * np.sqrt(0.95 * 0.05 / 200_000)


# --- Monte Carlo ---------------------------------------------------------------------------------


def assert_within_chance(row, errors=4.5):
    for part in ("horizontal", "vertical"):
        apart = abs(row[f"simulated_{part}_m"] - row[f"linear_{part}_m"])
        assert apart < errors * row[f"standard_error_{part}_m"]
    spread = np.sqrt(0.95 * 0.05 / row["replicates"])
    assert abs(row["inside_95"] - 0.95) < errors * spread


@pytest.mark.parametrize("mounting", ["frd", "dfr"])
def test_linear_theory_agrees_with_the_exact_geometry(sensor, mounting):
    turned = replace(sensor, mounting=parse_frame(mounting))
    setup = Setup(offset_forward=0.02, offset_right=-0.01, sensor_height=1.5, top_sigma=2e-3)
    table = simulate(setup, turned, TILTS[1:], 400, 5)
    for _, row in table.iterrows():
        assert_within_chance(row)
    assert "differs" not in agreement(table)


def test_each_source_alone_agrees_with_the_exact_geometry(sensor):
    nothing = dict.fromkeys(
        ("age", "temperature_change", "heading_sigma", "mounting_sigma", "length_sigma",
         "top_sigma", "top_sigma_vertical", "head_mass", "pole_mass"), 0.0,
    )  # fmt: skip
    quiet = replace(
        sensor,
        covariance=np.zeros((9, 9)),
        sheet=replace(SHEET, velocity_random_walk=1e-9, bias_instability=None),
    )
    alone = {
        "calibration": (replace(quiet, covariance=sensor.covariance), {}),
        "drift": (quiet, {"age": 1.0}),
        "temperature": (quiet, {"temperature_change": 20.0}),
        "mounting": (quiet, {"mounting_sigma": 50 * MGON}),
        "heading": (quiet, {"heading_sigma": 0.5 * GON}),
        "length": (quiet, {"length_sigma": 1e-3}),
    }
    for name, (one, given) in alone.items():
        (row,) = simulate(Setup(**{**nothing, **given}), one, TILTS[3:], 300, 7).to_dict("records")
        expected = np.sqrt(np.mean(of(name, one, TILTS[3:], **{**nothing, **given})[0] ** 2))
        assert row["linear_horizontal_m"] == pytest.approx(expected, rel=1e-3), name
        assert (
            abs(row["simulated_horizontal_m"] - expected) < 5 * row["standard_error_horizontal_m"]
        )


def test_a_heading_that_is_grossly_wrong_is_no_linear_matter(sensor):
    table = simulate(Setup(heading_sigma=0.5), sensor, TILTS[3:], 2000, 1)
    assert "trust the Monte Carlo" in agreement(table)


def test_draws_depend_on_the_seed_and_the_tilt_only(sensor):
    together = simulate(Setup(), sensor, TILTS[1:], 50, 3)
    alone = simulate(Setup(), sensor, TILTS[2:3], 50, 3)
    assert together.iloc[1].to_dict() == alone.iloc[0].to_dict()
    assert simulate(Setup(), sensor, TILTS[2:3], 50, 4).iloc[0].to_dict() != alone.iloc[0].to_dict()


def test_errors_of_nothing_are_zero(sensor):
    situation = situation_at(Setup(), sensor, TILTS)
    assert np.abs(situation.errors({})).max() < 1e-14
    rng = np.random.default_rng(1)
    assert draw(situation, 2, rng).shape == (2, len(TILTS) * 16, 3)


# --- words and quantities ------------------------------------------------------------------------


def test_the_source_that_limits_is_named(sensor):
    def millimetres(words, **setup):
        """Number that stands after some words."""
        text = " ".join(limits(budget(Setup(**setup), sensor, TILTS)))
        return float(re.search(rf"{words}: ([\d.]+) mm", text)[1])

    top, heading = "The position of the top limits it", "most of it the heading"
    assert millimetres(top) == pytest.approx(8.0, abs=0.11)
    assert millimetres(top, top_sigma=7e-3) == pytest.approx(7.0, abs=0.11)
    assert millimetres(heading, top_sigma=7e-3) == pytest.approx(6.7, abs=0.11)
    assert millimetres("The heading limits it", top_sigma=1e-4) == pytest.approx(6.7, abs=0.11)
    others = {"top_sigma": 0.0, "heading_sigma": 0.0, "head_mass": 0.0, "pole_mass": 0.0}
    assert millimetres("The temperature limits it", **others) == pytest.approx(1.3, abs=0.11)


def test_shares_of_the_table_make_the_whole(sensor):
    table = budget(Setup(), sensor, TILTS[1:]).table()
    assert len(table) == 3 * 16 * (len(sources()) + 1)
    parts = table[table["source"] != TOTAL].groupby(["tilt_gon", "direction_gon"])["share"].sum()
    np.testing.assert_allclose(parts, 1.0, rtol=1e-12)


@pytest.mark.parametrize(("texts", "why"), [
    ({"lenght": "2m"}, "did you mean 'length'"),
    ({"length": "2"}, "length: expected a number with its unit"),
    ({"length": "40m"}, "at most 30 m"),
    ({"sensor_height": "2.5m"}, "above the top of the pole"),
])  # fmt: skip
def test_what_is_no_pole_is_refused(texts, why):
    with pytest.raises(ValueError, match=why):
        setup_of(texts)
    assert setup_of({"length": "1.8 m", "heading_sigma": "0.1deg"}).length == 1.8
