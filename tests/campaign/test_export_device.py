"""Calibrations on a device: functions in C, compiled, and parameters of PX4."""

import ctypes
import json
import re
import shutil
import subprocess
from functools import cache

import numpy as np
import pytest
from calling import succeed
from campaign_helpers import with_keys

import accelstudy as acs
from accelstudy.campaign.calibration.c_code import c_header
from accelstudy.campaign.calibration.export import export
from accelstudy.campaign.calibration.file_format import CalibrationDocument, Correction, Quality
from accelstudy.campaign.calibration.sensor_calibration import SensorCalibration
from accelstudy.campaign.header import LogLayout
from accelstudy.effects import HoldConditions, effect_names, get_effect
from accelstudy.leveling.angles import roll_pitch
from accelstudy.sensors.frames import parse_frame
from accelstudy.sensors.models import compose

G = 9.81
MGON = np.pi / 200 / 1000
RANGES = {"temperature_degC": [10, 40], "time_s": [0, 1000], "vibration_mps2": [0, 0.5]}
BEFORE = ("hysteresis", "settling")
ALL = tuple(
    name for name in effect_names() if get_effect(name).part == "sensor" and name not in BEFORE
)
SOME = [
    ALL,
    ("thermal_bias(tau=300)",),
    ("learned(coordinate=temperature, low=10, high=40, length=1.5, amplitude=0.1)",),
    ("learned(coordinate=force, low=-15, high=15, length=1.5, amplitude=0.1)",),
    ("learned(coordinate=vibration, target=square, low=0, high=0.5, length=1.5, amplitude=0.001)",),
    ("learned(coordinate=time wave, period=300, amplitude=0.1)",),
    ("thermal_bias(tau=0.5)", "learned(coordinate=temperature rate, tau=100, length=1.5)"),
    ("bias", "scale", "nonorthogonality", "thermal_bias", "bias_drift", "vibration_rectification"),
]
"""Effects, all at once, of which one acts last, some shapes, and some that need no search."""
CONTENT = {
    "campaign": "made", "sensor": "a */ b", "model": "m", "approach": "gravity",
    "n_positions": 24, "quality": Quality(state="accepted"), "sigma_reading_mps2": 0.01,
    "unit": "m/s^2", "nominal": None, "gravity_mps2": G,
}  # fmt: skip


def calibration_with(specs, ranges=RANGES, values=None):
    """A calibration of effects of cheap equipment."""
    model = compose("m", specs)
    u, rng = model.n_parameters, np.random.default_rng(model.n_parameters)
    if values is None:
        sizes = [np.minimum(e.typical[1], e.deviations) for e in model.effects]
        values = np.concatenate(sizes) * rng.choice([-1, 1], u)
    root = 0.1 * np.abs(values)[:, None] * (np.eye(u) + rng.uniform(-0.2, 0.2, (u, u)))
    document = CalibrationDocument.model_construct(**CONTENT, ranges=ranges)
    return SensorCalibration(document, model, np.array(values), root @ root.T)


def conditions(n, until=1000.0):
    rng = np.random.default_rng(7)
    return {
        "temperature": rng.uniform(10, 40, n),
        "time": np.sort(rng.uniform(0, until, n)),
        "vibration": rng.uniform(0, 0.5, n),
    }


def attitudes(n, size=1.0):
    vectors = np.random.default_rng(5).normal(size=(n, 3))
    return size * G * vectors / np.linalg.norm(vectors, axis=1)[:, None]


def holds(known):
    still = np.zeros(len(known["time"]))
    return HoldConditions(**known, step_x=still, step_y=still, step_z=still)


def readings_of(calibration, forces, hold):
    """Output of a sensor, composed of its effects by NumPy alone."""
    effects, values, axes = [], iter(calibration.parameters), np.eye(3)
    for effect in calibration.model.effects:
        p = tuple(next(values) for _ in effect.parameters)
        axes += np.array(effect.axes(p, np), dtype=float)
        effects.append((effect, p))
    output = np.linalg.solve(axes, forces.T)
    for last in (False, True):
        of = tuple(output)
        for effect, p in effects:
            if effect.last == last:
                added = effect.output(of, p, G, hold, np)
                output = output + np.stack([a + np.zeros(len(forces)) for a in added])
    return output.T


class Library:
    """Functions of calibrations, all compiled together, in one precision."""

    def __init__(self, calibrations, folder, double):
        self.calibrations = calibrations
        self.real = ctypes.c_double if double else ctypes.c_float
        self.names, self.columns, texts = {}, {}, []
        for i, (key, calibration) in enumerate(calibrations.items()):
            name = self.names[key] = f"some{i}"
            header = c_header(calibration, "double" if double else "float").replace(
                "ACCEL_CALIBRATION_H", f"{name}_H"
            )
            texts.append(re.sub(r"\baccel_(\w+)", rf"{name}_\1", header))
            signature = re.search(rf"{name}_calibrate\(([^)]*)\)", texts[-1].split("*/", 1)[1])[1]
            self.columns[key] = [part.split()[-1] for part in signature.split(",")[1:-1]]
            given = "".join(f", known[{k} * n + i]" for k in range(len(self.columns[key])))
            texts.append(
                f"void run_{name}(int n, const {name}_real *reading, const {name}_real *known,"
                f" {name}_real *out)\n{{\n    int i;\n    (void)known;\n"
                f"    for (i = 0; i < n; i++)\n        {name}_calibrate(reading + 3 * i{given},"
                " out + 3 * i);\n}"
            )
        source, library = folder / "all.c", folder / "all.so"
        source.write_text("\n".join(texts), encoding="utf-8")
        warnings = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-Wdouble-promotion"]
        command = ["cc", *warnings, "-shared", "-fPIC", "-o", library, source, "-lm"]
        subprocess.run(command, check=True)
        self._library = ctypes.CDLL(str(library))

    def __call__(self, key, readings, known):
        """Forces (n, 3); what lags behind the thermometer is as warm if it is not known."""
        pointer, n = ctypes.POINTER(self.real), len(readings)
        of = [
            known["temperature"] if "lagged" in column and column not in known else known[column]
            for column in self.columns[key]
        ]
        arrays = [np.ascontiguousarray(a, self.real) for a in (readings, of or [np.zeros(n)])]
        out = np.full((n, 3), np.nan, dtype=self.real)
        reading, columns, result = (a.ctypes.data_as(pointer) for a in (*arrays, out))
        getattr(self._library, f"run_{self.names[key]}")(n, reading, columns, result)
        return out.astype(float)


LAG, CLIPS, FRAMES = ("thermal_bias(tau=300)",), ("saturation(knee=9)",), ("flu", "rfu")
TURN = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]])
COUNTS = {"scale": [5e-5, 4.7e-5, 4.6e-5], "offset": [2**23 + 0.3, 2**23 + 500.4, 2**23 - 900.2]}
needs_cc = pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler (cc)")


@pytest.fixture(scope="module")
def double(tmp_path_factory):
    """Models in double precision."""
    made = {specs: calibration_with(specs) for specs in SOME}
    return Library(made, tmp_path_factory.mktemp("c"), double=True)


@pytest.fixture(scope="module")
def single(tmp_path_factory):
    """All effects, one that clips, and one that takes counts, in single precision."""
    made = {ALL: calibration_with(ALL)}
    made[CLIPS] = calibration_with(CLIPS, values=[1.0, 1.001, 1.001])
    linear = calibration_with(("bias", "scale", "nonorthogonality", "quadratic_scale"))
    mended = Correction(error="axis_error", reason="x is y", matrix=TURN.tolist())
    for frame in FRAMES:
        layout = LogLayout(unit="counts", frame=frame, **COUNTS)
        made[frame] = with_keys(linear, log=layout, mended=mended)
    return Library(made, tmp_path_factory.mktemp("c"), double=False)


@needs_cc
@pytest.mark.parametrize("specs", SOME, ids=" ".join)
def test_c_of_each_effect_is_what_apply_does(specs, double):
    """Forces; also after the session, when drifts have ended."""
    calibration, known = double.calibrations[specs], conditions(60, until=2000.0)
    known["temperature"] = np.full(60, 27.0)  # nothing lags behind it
    readings = readings_of(calibration, attitudes(60), holds(known))
    expected = calibration.correct(readings, holds(known))
    assert np.isfinite(expected).all()
    np.testing.assert_allclose(double(specs, readings, known), expected, rtol=0, atol=2e-6)


@needs_cc
def test_c_in_single_precision_gives_the_force_that_made_the_reading(single):
    """Readings are composed by NumPy; the error is below what the head of a header says."""
    known = conditions(40)
    for size in (0.6, 1.45):
        forces = attitudes(40, size)
        readings = readings_of(single.calibrations[ALL], forces, holds(known))
        force = single(ALL, readings, known)
        np.testing.assert_allclose(force, forces, rtol=0, atol=size * 1.1e-5)


@needs_cc
def test_c_follows_a_lag_as_its_head_says(double):
    time = np.arange(0.0, 1000.0)
    temperature = 20 + 15 * (time / 1000)
    lagged, factor = [temperature[0]], 1 - np.exp(-1 / 300)
    for now in temperature[1:]:
        lagged.append(lagged[-1] + (now - lagged[-1]) * factor)
    readings = np.tile([0.0, 0.0, -G], (len(time), 1))
    force = double(LAG, readings, {"temperature_lagged_300": np.array(lagged)})
    hold = HoldConditions(time=time, temperature=temperature)
    expected = double.calibrations[LAG].correct(readings, hold)
    largest = 0.007 * 0.5 * 15 / 1000  # half a second behind a straight line, at 7 mm/s²/K
    np.testing.assert_allclose(force, expected, rtol=0, atol=1.1 * largest)


@needs_cc
def test_c_has_no_force_where_apply_has_none(single):
    """Beyond the knee of hard clipping; a loss of gain of 1.001 has roots at -500 m/s² there."""
    readings = np.array([[0.0, 0.0, -8.0], [9.5, 0.0, 0.0], [0.0, 9.5, 0.0], [0.0, 9.5, -9.5]])
    force = single(CLIPS, readings, {})
    np.testing.assert_allclose(force[0], [0, 0, -8], atol=1e-5)
    assert np.isnan(force[1:]).all()
    assert np.isnan(single.calibrations[CLIPS].correct(readings)[1:]).any(axis=1).all()


@needs_cc
@pytest.mark.parametrize("frame", FRAMES)
def test_c_takes_counts_in_the_axes_of_the_log(frame, single):
    """A large offset costs no digits: the first thing that is done is to take it away."""
    forces, axes = attitudes(30), parse_frame(frame)
    read = readings_of(single.calibrations[frame], forces, HoldConditions()) @ TURN
    counts = np.round(axes.from_frd(read) / COUNTS["scale"] + COUNTS["offset"])
    exact = axes.to_frd((counts - COUNTS["offset"]) * COUNTS["scale"]) @ TURN.T
    expected = axes.from_frd(single.calibrations[frame].correct(exact))
    np.testing.assert_allclose(single(frame, counts, {}), expected, rtol=0, atol=5e-6)


@cache
def calibration_of(model):
    """A calibration of a campaign that has the effects beside a model."""
    warm = {"temperature": (10, 40), "temperature_order": "random"} if "thermal" in model else {}
    campaign = acs.simulate_campaign(
        scheme="fibonacci-36", repeat_first=6, order="random", seed=11,
        effects=model.split("+")[1:], **warm,
    )  # fmt: skip
    return acs.calibrate(campaign, model=model, approach="gravity")


NINE = "bias-scale-nonorthogonality"


def written(folder, model, **changes):
    """Path of calibration.json."""
    path = folder / "calibration.json"
    path.write_text(json.dumps({**calibration_of(model).content, **changes}), encoding="utf-8")
    return path


INJECTED = "x\n1\t1\tCAL_ACC0_XOFF\t9\t9\x1b[31m\u2028*/"


@pytest.mark.parametrize("form", ["px4", "c"])
def test_a_name_is_no_line_of_an_export(tmp_path, form):
    path = written(tmp_path, NINE, sensor=INJECTED, campaign=INJECTED)
    text = succeed("export", path, "--form", form).stdout
    assert not any(line.startswith("1\t1\tCAL_ACC0_XOFF\t9") for line in text.splitlines())
    assert "\x1b" not in text
    assert "\u2028" not in text


def px4_of(text):
    """Parameters of a file for QGroundControl."""
    rows = [line.split("\t") for line in text.splitlines() if not line.startswith("#")]
    assert all(len(row) == 5 and len(row[2]) <= 16 for row in rows)
    assert all(("." in row[3]) == (row[4] == "9") and "e" not in row[3] for row in rows)
    assert {row[4]: row[2] for row in rows if row[4] == "6"} in ({}, {"6": "TC_A_ENABLE"})
    return {name: float(value) for _, _, name, value, _ in rows}


def corrected_by_px4(p, readings, temperature):
    """What PX4 makes of readings, as its documentation says."""
    warmer = np.clip(temperature, p.get("TC_A0_TMIN", 0), p.get("TC_A0_TMAX", 0)) - p.get(
        "TC_A0_TREF", 0
    )
    columns = []
    for i, axis in enumerate("XYZ"):
        thermal = sum(p.get(f"TC_A0_X{k}_{i}", 0.0) * warmer**k for k in range(4))
        offset, scale = p[f"CAL_ACC0_{axis}OFF"], p[f"CAL_ACC0_{axis}SCALE"]
        columns.append((readings[:, i] - thermal - offset) * scale)
    return np.stack(columns, axis=1)


def test_px4_holds_bias_scale_and_curves_of_the_temperature(tmp_path):
    model = "bias-scale+thermal_bias+thermal_curve"
    calibration = calibration_of(model).sensor
    text, lost = export(calibration, "px4")
    third = acs.export(written(tmp_path, model, log={"variable": "2"}), form="px4")
    assert third == re.sub(r"(CAL_ACC|TC_A)0_", r"\g<1>2_", text)
    parameters = px4_of(text)
    assert lost == []
    assert parameters["TC_A_ENABLE"] == 1
    temperature = np.linspace(*calibration.ranges["temperature_degC"], 30)
    hold = HoldConditions(temperature=temperature)
    readings = readings_of(calibration, attitudes(30), hold)
    expected = calibration.correct(readings, hold)
    corrected = corrected_by_px4(parameters, readings, temperature)
    np.testing.assert_allclose(corrected, expected, atol=1e-6)


@pytest.mark.parametrize("model", [NINE, f"{NINE}+quadratic_scale"])
def test_what_px4_cannot_hold_is_said_with_its_size(model, tmp_path):
    """The errors of roll and pitch by a device of our own, at tilts drawn at random."""
    result = succeed("export", written(tmp_path, model), "--form", "px4")
    (warning,) = result.stderr.splitlines()
    assert "no place for more;" in warning
    assert warning.removeprefix("warning: ") in result.stdout
    said = [float(n) for n in re.findall(r"by ([\d.]+) mgon", warning)[:2]]
    calibration = calibration_of(model).sensor
    rng, n = np.random.default_rng(3), 20000
    z, azimuth = rng.uniform(np.cos(np.pi / 4), 1, n), rng.uniform(0, 2 * np.pi, n)
    r = np.sqrt(1 - z**2)
    forces = -calibration.gravity * np.stack([r * np.cos(azimuth), r * np.sin(azimuth), z], axis=1)
    temperature = np.full(n, 20.0)
    readings = readings_of(calibration, forces, HoldConditions(temperature=temperature))
    found = corrected_by_px4(px4_of(result.stdout), readings, temperature)
    error = np.subtract(roll_pitch(tuple(found.T)), roll_pitch(tuple(forces.T))) / MGON
    np.testing.assert_allclose(np.sqrt(np.mean(error**2, axis=1)), said, rtol=0.03)


def test_px4_has_no_lag():
    _, (loss,) = export(calibration_of("bias-scale+thermal_bias(tau=300)").sensor, "px4")
    assert "thermal_bias with one of 300 s is right at a settled temperature only" in loss
