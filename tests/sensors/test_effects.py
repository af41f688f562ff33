"""The effects of the catalogue: all there, as their formulas say, estimable or known not to be."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from usual import GRAVITY, ROBOT, G

from accelstudy.adjustment import calibrate
from accelstudy.adjustment.linear_theory import LinearTheory
from accelstudy.design.estimability import estimability
from accelstudy.effects import Effect, HoldConditions, TemperatureCourse, effect_names, get_effect
from accelstudy.effects.hold_conditions import MIN_STEP
from accelstudy.effects.saturation import ROUND_WIDTH
from accelstudy.leveling.angles import roll_pitch, specific_force
from accelstudy.schemes import get_scheme
from accelstudy.sensors.sensor import SensorModel
from accelstudy.simulation.sessions import Noise, session

NINE = ("bias", "scale", "nonorthogonality")
SCHEME = get_scheme("mclaren-24")

RIG = {
    *("gravity_error", "base_tilt", "encoder_offset", "encoder_scale", "encoder_eccentricity"),
    *("axis_nonperpendicularity", "joint_compliance", "mounting_slip"),
}
OTHERS = [name for name in effect_names() if name not in NINE]
EACH = pytest.mark.parametrize("name", effect_names())


def some_hold(forces, seed=2, **columns):
    """Holds with everything in them, at random."""
    rng = np.random.default_rng(seed)
    n = len(forces)
    roll, pitch = roll_pitch(tuple(forces.T))
    known = {
        "temperature": rng.uniform(-10, 50, n),
        "time": np.cumsum(rng.uniform(30, 90, n)),
        "vibration": rng.uniform(0, 1, n),
        "yaw": rng.uniform(-np.pi, np.pi, n),
    }
    return HoldConditions(**{**known, "roll": roll, "pitch": pitch, **columns}).with_steps(forces)


FORCES = G * np.random.default_rng(1).uniform(-1.2, 1.2, (40, 3))
HOLD = some_hold(FORCES)


def added(effect, p, forces=FORCES, hold=HOLD):
    """What the effect adds: to the axes times f, to the output, and to the angles."""
    n = len(forces)
    angles = (hold.roll, hold.pitch)

    def rows(parts):
        return np.stack([np.broadcast_to(np.asarray(part, dtype=float), n) for part in parts], 1)

    axes = forces @ np.array(effect.axes(tuple(p), np), dtype=float).T
    return SimpleNamespace(
        axes=axes,
        output=rows(effect.output(tuple(forces.T), tuple(p), G, hold, np)),
        reading=rows(effect.reading(angles, tuple(p), hold, np)),
    )


# --- the catalogue -------------------------------------------------------------------------------


def test_every_effect_has_a_formula_here_and_is_of_the_sensor_or_of_its_rig():
    formulas = {spec.partition("(")[0] for spec in (*OUTPUT, *AXES, *READING)}
    assert {*effect_names()} == formulas
    assert {name for name in formulas if get_effect(name).part == "rig"} == RIG


@EACH
def test_what_people_read_of_an_effect(name):
    effect = get_effect(name)
    assert effect.name == name
    assert effect.__doc__
    # Those that come from the formula, and those that an effect says itself.
    for equation, (low, high) in (
        (Effect.equation.fget(effect), Effect.typical.fget(effect)),
        (effect.equation, effect.typical),
    ):
        assert equation
        assert 0 < low < high
    assert len({p.unit for p in effect.parameters}) == 1
    assert all(p.symbol.startswith("$") and p.symbol.endswith("$") for p in effect.parameters)


# --- formulas ------------------------------------------------------------------------------------

# Each as the catalogue writes it, of f (n, 3), the forces before, the parameters and the holds.


def base_tilt(f, f_prev, p, h):
    attitude = Rotation.from_euler("ZYX", np.stack([h.yaw, h.pitch, h.roll], axis=1))
    return attitude.inv().apply([p[0], p[1], 0]) * G


def skew_axes(f, f_prev, p, h):
    """A force that is turned by k tan θ about the roll axis."""
    level = np.stack(specific_force(h.roll, h.pitch, G), axis=1)
    return p[0] * np.tan(h.pitch)[:, None] * np.cross([1.0, 0.0, 0.0], level)


def per_other_axis(f, k):
    """Σ k_ij f_i f_j over the other axes j, with k in the order xy, xz, yx, yz, zx, zy."""
    pairs = [(0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1)]
    e = np.zeros_like(f)
    for value, (i, j) in zip(k, pairs, strict=True):
        e[:, i] += value * f[:, i] * f[:, j] / G
    return e


OUTPUT = {
    "bias": lambda f, f_prev, p, h: p + 0 * f,
    "scale": lambda f, f_prev, p, h: p * f,
    "mounting_rotation": lambda f, f_prev, p, h: np.cross(p, f),
    "quadratic_scale": lambda f, f_prev, p, h: p * f**2 / G,
    "cubic_scale": lambda f, f_prev, p, h: p * f**3 / G**2,
    "scale_asymmetry": lambda f, f_prev, p, h: p * np.abs(f),
    "cross_coupling": lambda f, f_prev, p, h: per_other_axis(f, p),
    "thermal_bias": lambda f, f_prev, p, h: np.outer(h.temperature - 20, p),
    "thermal_scale": lambda f, f_prev, p, h: np.outer(h.temperature - 20, p) * f,
    "thermal_nonorthogonality": lambda f, f_prev, p, h: (
        np.stack([-p[0] * f[:, 1] + p[1] * f[:, 2], -p[2] * f[:, 2], 0 * f[:, 0]], 1)
        * (h.temperature - 20)[:, None]
    ),
    "warm_up": lambda f, f_prev, p, h: np.outer(np.exp(-h.time / 600), p),
    "warm_up(tau=300)": lambda f, f_prev, p, h: np.outer(np.exp(-h.time / 300), p),
    "bias_drift": lambda f, f_prev, p, h: np.outer(h.time, p),
    "bias_jump": lambda f, f_prev, p, h: np.outer(h.time > 600, p),
    "bias_jump(t=1000)": lambda f, f_prev, p, h: np.outer(h.time > 1000, p),
    "hysteresis": lambda f, f_prev, p, h: p * np.sign(f - f_prev),
    "settling": lambda f, f_prev, p, h: p[0] * (f_prev - f),
    "vibration_rectification": lambda f, f_prev, p, h: np.outer(h.vibration**2, p),
    "saturation": lambda f, f_prev, p, h: -p * np.sign(f) * np.maximum(0, np.abs(f) - 0.95 * G),
    "saturation(knee=5)": lambda f, f_prev, p, h: -p * np.sign(f) * np.maximum(0, np.abs(f) - 5),
    "gravity_error": lambda f, f_prev, p, h: p[0] * f / G,
    "base_tilt": base_tilt,
    "axis_nonperpendicularity": skew_axes,
    "thermal_curve": lambda f, f_prev, p, h: np.outer((h.temperature - 20) ** 2, p),
    "mounting_slip": lambda f, f_prev, p, h: (h.time > 600)[:, None] * np.cross(p, f),
}
AXES = {
    "nonorthogonality": lambda f, p: np.stack(
        [-p[0] * f[:, 1] + p[1] * f[:, 2], -p[2] * f[:, 2], 0 * f[:, 0]], 1
    ),
    "cross_axis_misalignment": lambda f, p: np.stack(
        [0 * f[:, 0], p[0] * f[:, 0], -p[1] * f[:, 0] + p[2] * f[:, 1]], 1
    ),
}
READING = {
    "encoder_offset": lambda a, p: p + 0 * a,
    "encoder_scale": lambda a, p: p * a,
    "encoder_eccentricity": lambda a, p: p[[0, 2]] * np.sin(a) + p[[1, 3]] * np.cos(a),
    "encoder_eccentricity(order=2)": lambda a, p: (
        p[[0, 2]] * np.sin(2 * a) + p[[1, 3]] * np.cos(2 * a)
    ),
    "joint_compliance": lambda a, p: -p * np.sin(2 * a) * np.cos(a[:, ::-1]),
}


@pytest.mark.parametrize("spec", [*OUTPUT, *AXES, *READING])
def test_the_formula_of_the_catalogue(spec):
    effect = get_effect(spec)
    p = np.random.default_rng(3).normal(0, effect.typical[1], len(effect.parameters))
    f_prev = np.concatenate([FORCES[:1], FORCES[:-1]])
    # No step of these forces is so small that it counts as none.
    assert np.abs(FORCES - f_prev)[1:].min() > MIN_STEP
    angles = np.stack([HOLD.roll, HOLD.pitch], axis=1)
    zero = np.zeros_like(FORCES)
    found = added(effect, p)
    expected = {
        "output": OUTPUT[spec](FORCES, f_prev, p, HOLD) if spec in OUTPUT else zero,
        "axes": AXES[spec](FORCES, p) if spec in AXES else zero,
        "reading": READING[spec](angles, p) if spec in READING else zero[:, :2],
    }
    for kind, values in expected.items():
        scale = np.abs(values).max()
        np.testing.assert_allclose(getattr(found, kind), values, rtol=0, atol=1e-13 * scale)


def test_no_step_is_no_hysteresis():
    forces = np.repeat(FORCES[:3], 2, axis=0)
    e = added(get_effect("hysteresis"), np.ones(3), forces, some_hold(forces)).output
    np.testing.assert_array_equal(e[[0, 1, 3, 5]], 0)
    noisy = forces + np.random.default_rng(1).normal(0, 0.002, forces.shape)
    e = added(get_effect("hysteresis"), np.ones(3), noisy, some_hold(noisy)).output
    np.testing.assert_array_equal(e[[0, 1, 3, 5]], 0)


def test_a_sensor_clips_what_it_reads():
    """With its bias, its scale and all else, wherever the saturation stands in the model."""
    names = ("saturation(knee=9)", "bias", "scale", "nonorthogonality", "quadratic_scale")
    values = {"b_x": 0.3, "b_z": -0.2, "s_x": 0.03, "s_y": -0.02, "alpha_yz": 0.01, "k2_y": 5e-3}
    free, clipping = SensorModel.of("free", names[1:]), SensorModel.of("clipping", names)
    read = free.sense(FORCES, free.vector(values), G)
    sharp = np.all(np.abs(np.abs(read) - 9) > ROUND_WIDTH, axis=1)
    assert sharp.sum() > 20
    assert np.sum(np.abs(read[sharp]) > 9) > 5
    hard = {**values, **dict.fromkeys(("k_sat_x", "k_sat_y", "k_sat_z"), 1.0)}
    made = clipping.sense(FORCES, clipping.vector(hard), G)
    np.testing.assert_allclose(made[sharp], np.clip(read, -9, 9)[sharp], rtol=0, atol=1e-12)
    soft = clipping.vector({**hard, "k_sat_x": 0.4, "k_sat_y": 0.1, "k_sat_z": 0.7})
    back = clipping.correct(clipping.sense(FORCES, soft, G), soft, G)
    np.testing.assert_allclose(back, FORCES, rtol=0, atol=1e-11)


def test_axes_that_are_not_perpendicular_show_where_the_roll_axis_is_vertical():
    hold = some_hold(FORCES, roll=np.full(40, 0.3), pitch=np.full(40, np.pi / 2))
    found = added(get_effect("axis_nonperpendicularity"), np.array([1e-3]), FORCES, hold)
    expected = 1e-3 * G * np.array([0.0, np.cos(0.3), -np.sin(0.3)])
    np.testing.assert_allclose(found.output, np.tile(expected, (40, 1)), rtol=0, atol=1e-14)


def test_a_flange_gives_way_where_its_encoders_do_not_see_it():
    """The attitude is what the encoders say and the deflection there; a positive one is ahead."""
    model = SensorModel.of("robot", ["joint_compliance"])
    attitude, c = np.array([[0.4, -0.3], [2.0, 0.5]]), np.array([1e-3, -2e-3])
    read = attitude + model.reading_errors(attitude, c)
    deflected = c * np.sin(2 * read) * np.cos(read[:, ::-1])
    np.testing.assert_allclose(read + deflected, attitude, rtol=0, atol=1e-14)
    assert read[0, 0] < attitude[0, 0]


def test_a_sensor_that_lags_behind_its_thermometer():
    """As the differential equation of the lag has it, solved by small steps."""
    time, temperature = np.array([100.0, 160.0, 230.0, 400.0]), np.array([20.0, 25.0, 25.0, 10.0])
    fine = np.arange(100.0, 900.0, 0.01)
    outside = np.interp(fine, time, temperature)
    body, share = [outside[0]], np.exp(-0.01 / 80)
    for value in outside[1:]:
        body.append(share * body[-1] + (1 - share) * value)
    at = np.array([130.0, 160.0, 300.0, 400.0, 600.0])
    found = TemperatureCourse(time, temperature).behind(at, 80) + np.interp(at, time, temperature)
    np.testing.assert_allclose(found, np.interp(at, fine, body), atol=2e-3)
    assert TemperatureCourse(time, temperature).behind(50.0, 80) == 0


def test_a_lag_is_a_setting_of_the_thermal_bias():
    plain, lagging = get_effect("thermal_bias"), get_effect("thermal_bias(tau=500)")
    assert plain.spec == get_effect("thermal_bias(tau=0)").spec == "thermal_bias"
    assert plain.equation == "b_T,i (T − T0)"
    assert "lag" in lagging.equation
    assert SensorModel.of("lag", [lagging.spec]).hold_columns == ("temperature", "time")
    p = np.array([1e-3, 2e-3, -1e-3])
    expected = np.outer(HOLD.lagged(500) - 20, p)
    np.testing.assert_allclose(added(lagging, p).output, expected, atol=1e-14)
    # What came before some holds came before them, though they are left out.
    some = np.array([3, 17, 30])
    np.testing.assert_array_equal(HOLD.take(some).lagged(500), HOLD.lagged(500)[some])
    lags = [c.settings["tau"] for c in plain.candidates(HOLD, FORCES, G)]
    assert lags[0] == 0
    assert lags[-1] < np.ptp(HOLD.time) / 3


# --- specs and candidates ------------------------------------------------------------------------


@EACH
def test_specs_and_candidates(name):
    effect = get_effect(name)
    candidates = effect.candidates(HOLD, FORCES, G)
    assert len(candidates) > 1 if effect.takes else candidates == (effect,)
    assert len({candidate.spec for candidate in candidates}) == len(candidates)
    for candidate in (effect, *candidates):
        again = get_effect(candidate.spec)
        assert type(again) is type(effect)
        assert again.settings == pytest.approx(candidate.settings, rel=1e-11)
        assert again.spec == candidate.spec


def test_candidates_fit_the_session():
    times = [c.settings["t"] for c in get_effect("bias_jump").candidates(HOLD, FORCES, G)]
    assert len(times) == 37
    for t in times:
        assert min(np.sum(t > HOLD.time), np.sum(t < HOLD.time)) >= 2
    session_length = np.ptp(HOLD.time)
    for candidate in get_effect("warm_up").candidates(HOLD, FORCES, G):
        assert session_length / 21 < candidate.settings["tau"] < session_length * 1.01
    for candidate in get_effect("saturation").candidates(HOLD, FORCES, G):
        assert 0.49 * G < candidate.settings["knee"] < G
    for full, expected in ((0.82, [0.5, 0.8]), (2.7, [0.7, 0.99]), (8, [])):
        within = replace(HOLD, full_range=full * G).take(np.arange(30))
        knees = [c.settings["knee"] for c in get_effect("saturation").candidates(within, FORCES, G)]
        np.testing.assert_allclose(np.divide(knees, G)[[0, -1] if knees else []], expected, 1e-3)
    few = some_hold(FORCES[:3], time=np.arange(3.0))
    assert get_effect("bias_jump").candidates(few, FORCES[:3], G) == ()


# --- estimation ----------------------------------------------------------------------------------


def model_of(*effects):
    return SensorModel.of("test", (*NINE, *effects))


def design(*effects, approach=ROBOT, scheme=SCHEME, **columns):
    directions = scheme.directions
    hold = some_hold(-G * directions, **columns)
    return estimability(scheme, model_of(*effects), approach, hold=hold)


# What shapes the effect so that these 24 positions see it on every axis.
SHAPES = {"saturation": "saturation(knee=6)"}


@pytest.mark.parametrize("name", [name for name in OTHERS if name != "gravity_error"])
def test_every_effect_can_be_estimated(name):
    """Mean error zero, and the sd of linear theory, with a robot and 24 positions."""
    replicates = 400
    effect = get_effect(SHAPES.get(name, name))
    model = model_of(effect.spec)
    hold = some_hold(-G * SCHEME.directions)
    truth = model.vector({"b_x": 0.05, "b_z": -0.02, "s_y": 1e-3, "alpha_zx": 1e-3})
    truth[9:] = np.resize([1, -1], len(truth) - 9) * math.sqrt(math.prod(effect.typical))
    ideal = session(model, truth, SCHEME.directions, hold=hold)
    noise = Noise()
    expected = LinearTheory.of(model, ROBOT, ideal.observations(noise))
    observed = ideal.draw(noise, replicates, np.random.default_rng(5))
    result = calibrate(model, ROBOT, observed)
    assert result.converged.all()
    z = (result.parameters - truth) / expected.sigma
    # Some 250 statements of either kind over all effects.
    assert np.abs(z.mean(axis=0)).max() < 4.5 / math.sqrt(replicates)
    assert np.abs(z.std(axis=0) - 1).max() < 4.5 / math.sqrt(2 * replicates)


@pytest.mark.parametrize(("effects", "approach", "columns", "rank"), [
    # Mounting rotation and cross-axis misalignment span the same three dimensions.
    (("mounting_rotation", "cross_axis_misalignment"), ROBOT, {}, 12),
    # A zero offset of roll is a rotation about x; one of pitch is none.
    (("mounting_rotation", "encoder_offset"), ROBOT, {}, 13),
    # A zero offset of pitch is a tilt of the base, unless the yaw varies.
    (("base_tilt", "encoder_offset"), ROBOT, {"yaw": np.zeros(60)}, 12),
    (("base_tilt", "encoder_offset"), ROBOT, {}, 13),
    (("quadratic_scale", "cross_coupling"), GRAVITY, {}, 15),
    (("quadratic_scale", "cross_coupling"), ROBOT, {}, 18),
    # Constant temperature is a bias and a scale.
    (("thermal_bias", "thermal_scale"), ROBOT, {"temperature": np.full(60, 35.0)}, 9),
    # Steps of 45° see one odd nonlinearity.
    (("cubic_scale", "saturation(knee=8)"), ROBOT, {}, 15),
    (("cubic_scale", "saturation(knee=8)"), ROBOT, {"scheme": get_scheme("faces-edges-18")}, 12),
])  # fmt: skip
def test_what_equals_what(effects, approach, columns, rank):
    given = {"scheme": get_scheme("fibonacci-60"), **columns}
    assert design(*effects, approach=approach, **given).rank == rank


# --- columns of the holds ------------------------------------------------------------------------


def test_an_effect_with_some_of_its_parameters():
    """The others are zero, in arrays and in generated code; all of them are the effect itself."""
    whole = get_effect("saturation(knee=9)")
    part = whole.with_parameters((0, 2))
    assert [p.name for p in part.parameters] == ["k_sat_x", "k_sat_z"]
    assert part.spec == f"{whole.spec}[k_sat_x, k_sat_z]"
    assert type(get_effect(part.spec)) is type(part)
    assert type(whole.with_parameters((0, 1, 2))) is type(whole)
    assert type(whole.with_parameters((0, 2))) is type(part)
    forces = 9.8 * np.array([[1, 0, 0], [0, 1, 0], [0, 0, -1], [0.6, 0.8, 0]])
    expected = SensorModel("whole", (whole,)).sense(forces, [0.1, 0.0, 0.3])
    np.testing.assert_array_equal(SensorModel("part", (part,)).sense(forces, [0.1, 0.3]), expected)
