"""A calibration applied to readings, and leveling with its sigmas."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from calling import refused
from campaign_helpers import simulated_campaign, with_keys
from usual import NINE, ROBOT

import accelstudy as acs
from accelstudy.adjustment import calibrate
from accelstudy.basics.errors import InputError
from accelstudy.basics.units import GON, MGON
from accelstudy.campaign.calibration.leveling import level
from accelstudy.campaign.calibration.result import Calibration
from accelstudy.campaign.header import LogLayout
from accelstudy.effects import HoldConditions
from accelstudy.leveling.angles import specific_force
from accelstudy.schemes import get_scheme
from accelstudy.sensors.frames import parse_frame
from accelstudy.sensors.models import get_model
from accelstudy.simulation.sessions import Noise, session

TRUTH = {"b_x": 0.05, "b_y": 0.01, "s_z": 2e-4, "alpha_zx": 7e-4}
AXES = ["fx", "fy", "fz"]


@pytest.fixture(scope="module")
def plain():
    """A calibration of the nine parameters, with a robot."""
    return acs.calibrate(simulated_campaign(TRUTH), approach="robot").sensor


def level_log(calibration, log, out, *given, **options):
    """Level a log, and write it."""
    leveled = level(calibration, log, *given, **options)
    leveled.write(out)
    return leveled


def calibrated_in(table):
    return table[[f"f{axis}_calibrated_mps2" for axis in "xyz"]]


def test_sigmas_of_leveling_hold_over_calibrations_and_readings(plain):
    """Errors of roll and pitch over 300 calibrations, each with a reading, against the sigma."""
    attitude = np.array([30 * GON, -20 * GON])
    f_b = np.array(specific_force(*attitude, 9.80665))
    f_s = NINE.sense(f_b[None], NINE.vector(TRUTH))[0]
    rng = np.random.default_rng(5)
    drawn = session(NINE, NINE.vector(TRUTH), get_scheme("mclaren-24").directions).draw(
        Noise(sigma_force=0.002), 300, rng
    )
    fitted = calibrate(NINE, ROBOT, drawn)
    assert fitted.converged.all()
    errors, sigmas = [], []
    for parameters, cofactors in zip(fitted.parameters, fitted.cofactors, strict=True):
        calibration = replace(plain, parameters=parameters[:9], covariance=cofactors[:9, :9])
        reading = f_s + 0.001 * rng.standard_normal(3)
        angles, sigma = calibration.level(reading[None], 0.001)
        errors.append(angles[0] - attitude)
        sigmas.append(sigma[0])
    normalised = np.array(errors) / np.array(sigmas)
    assert np.abs(normalised.mean(axis=0)).max() < 4 / np.sqrt(300)
    assert np.abs(normalised.std(axis=0) - 1).max() < 4 / np.sqrt(2 * 300)


def test_sigmas_hold_where_the_sensor_loses_gain(plain):
    """Beyond a knee of 6 m/s² half the gain is left, so noise counts twice: σ/(½ g) in pitch."""
    model, g, noise = get_model("saturation(knee=6)"), 9.80665, 0.002
    calibration = replace(
        plain, model=model, parameters=np.full(3, 0.5), covariance=np.zeros((3, 3))
    )
    attitude = np.array([0.0, 50 * GON])  # x and z feel 6.9 m/s²
    reading = model.sense(np.column_stack(specific_force(*attitude, g)), calibration.parameters, g)
    _, ((_, sigma),) = calibration.level(reading, noise)
    assert sigma == pytest.approx(noise / (0.5 * g), rel=1e-9)
    drawn = reading + noise * np.random.default_rng(1).standard_normal((20_000, 3))
    angles, sigmas = calibration.level(drawn, noise)
    assert angles[:, 1].std() == pytest.approx(sigma, rel=4 / np.sqrt(2 * 20_000))
    pulls = (angles - attitude) / sigmas
    np.testing.assert_allclose(pulls.std(axis=0), 1, rtol=4.5 / np.sqrt(2 * 20_000))


# --- Effects that need more than the force -------------------------------------------------------

SESSION = 600.0
SIGMA = 1e-4
IDEAL = [f"{name}: 0, 0, 0" for name in ("bias", "scale", "nonorthogonality")]
ATTITUDES = np.random.default_rng(4).uniform(-60, 60, (40, 2)) * GON


def calibrated(effects, values, approach="gravity", **changes):
    """A calibration that has effects, in a session with time, temperature and vibration."""
    sizes = ", ".join(str(values.get(name, 0)) for name in get_model(effects).parameter_names)
    campaign = acs.simulate_campaign(
        seed=2, scheme="fibonacci-30", effects=(*IDEAL, f"{effects}: {sizes}"), sigma=SIGMA,
        robot_sigma="0.1mgon", interval=SESSION / 29, temperature="15:35",
        temperature_order="random", vibration="0:2", yaw="random",
    )  # fmt: skip
    model = f"bias-scale-nonorthogonality+{effects}"
    return acs.calibrate(campaign.with_arrays(**changes), model=model, approach=approach).sensor


def rows_of(effects, values, **columns):
    """Log of a sensor that has effects, in known attitudes and conditions."""
    model = get_model(f"bias-scale-nonorthogonality+{effects}")
    f_b = np.column_stack(specific_force(*ATTITUDES.T, 9.80665))
    hold = HoldConditions(**{k: np.broadcast_to(v, len(f_b)) for k, v in columns.items()})
    forces = model.sense(f_b, model.vector(values), 9.80665, hold.with_steps(f_b))
    return pd.DataFrame(dict(zip(AXES, forces.T, strict=True))).assign(**columns)


def leveled_rows(calibration, rows, given=None, **options):
    """The rows leveled, and the warnings."""
    leveled = level(calibration, rows, given, **options)
    return leveled.to_frame(), list(leveled.warnings)


def sigmas_in(table):
    """Sigmas of roll and pitch, mgon."""
    return table[["sigma_roll_mgon", "sigma_pitch_mgon"]].to_numpy()


def assert_leveled(table, rms=3):
    """Errors of roll and pitch are small (mgon), and within their sigmas."""
    errors = 1e3 * table[["roll_gon", "pitch_gon"]].to_numpy() - ATTITUDES / MGON
    assert np.sqrt(np.mean(errors**2)) < rms
    assert np.abs(errors / sigmas_in(table)).max() < 4.5


@pytest.mark.parametrize(("effects", "values", "columns"), [
    ("thermal_bias", {"b_T_x": 2e-3, "b_T_y": -3e-3}, {"temperature": np.linspace(16, 34, 40)}),
    ("thermal_scale", {"s_T_x": 2e-4, "s_T_z": 1e-4}, {"temperature": np.linspace(16, 34, 40)}),
    ("warm_up(tau=200)", {"w_x": 0.05, "w_y": 0.03}, {"time": np.linspace(0, 3000, 40)}),
    ("bias_jump(t=300)", {"c_x": 0.03, "c_z": 0.02}, {"time": np.linspace(0, 580, 40)}),
    ("bias_drift", {"d_x": 5e-5, "d_y": -4e-5}, {"time": np.linspace(0, 600, 40)}),
    ("vibration_rectification", {"K_vre_x": 5e-3}, {"vibration": np.linspace(0, 2, 40)}),
])  # fmt: skip
def test_what_depends_on_conditions_is_corrected_by_those_of_the_row(effects, values, columns):
    (condition,) = columns
    own, rows = calibrated(effects, values), rows_of(effects, values, **columns)
    table, warnings = leveled_rows(own, rows, sigma=0.0)
    assert_leveled(table)
    assert sigmas_in(table).max() < 20
    said = sum("start of the calibration session" in warning for warning in warnings)
    assert said == (condition == "time")
    stored = LogLayout(columns={c: c for c in ("temperature", "vibration")}, time=None)
    for known in (None, stored):
        with pytest.raises(InputError, match=rf"{effects.split('(')[0]} needs the {condition}.*`"):
            leveled_rows(with_keys(own, log=known), rows[AXES])


def test_a_lag_follows_the_thermometer():
    effects, values = "thermal_bias(tau=400)", {"b_T_x": 2e-3, "b_T_y": -3e-3}
    time = np.linspace(0, 2000, 40)
    rows = rows_of(effects, values, time=time, temperature=25 + 10 * np.sin(time / 500))
    table, (said,) = leveled_rows(calibrated(effects, values), rows, sigma=0.0)
    # The lag leaves little of the temperature in 10 minutes; uncorrected it makes about 100 mgon.
    assert_leveled(table, rms=20)
    assert "assumes that the sensor has the temperature of row 1" in said
    assert "start of the calibration session" not in said
    with refused("not after the row above"):
        leveled_rows(calibrated(effects, values), rows[::-1])


def test_the_noise_of_a_thermometer_lags_as_well():
    """At 10 rows a second 0.5 K of noise would make 1.5 mm/s² if it went to the bias as it is."""
    effects, values = "thermal_bias(tau=400)", {"b_T_x": 3e-3}
    time, rng = 0.1 * np.arange(40), np.random.default_rng(8)
    rows = rows_of(effects, values, time=time, temperature=np.full(40, 25.0))
    noisy = rows.assign(temperature=25 + 0.5 * rng.standard_normal(40))
    noisy.loc[0, "temperature"] = 25.0  # that of the sensor
    tables = [leveled_rows(calibrated(effects, values), t, sigma=0.0)[0] for t in (rows, noisy)]
    plain, lagged = map(calibrated_in, tables)
    np.testing.assert_allclose(lagged, plain, rtol=0, atol=1e-5)


def test_a_drift_stays_where_the_session_left_it():
    values = {"d_x": 5e-5, "d_y": -4e-5, "d_z": 3e-5}
    own = calibrated("bias_drift", values)
    # The sensor stops drifting at the end of the session, in the first tenth of the log.
    time = np.minimum(150.0 * np.arange(40), SESSION)
    rows, rate = rows_of("bias_drift", values, time=time)[AXES], {"rate": 1 / 150}
    table, (warning,) = leveled_rows(own, rows, rate, sigma=0.0, start=0)
    assert_leveled(table)
    assert "bias_drift: kept constant after the end of the calibration session" in warning
    assert "(600 s), in 35 of 40 rows" in warning
    # A day later nothing else is known, and no more is claimed to be unknown.
    later, _ = leveled_rows(own, rows, rate, sigma=0.0, start=86400)
    np.testing.assert_allclose(sigmas_in(later)[5:], sigmas_in(table)[5:], rtol=1e-9)
    reading = np.array([[0.1, 0.2, -9.8]])
    for time in (0.0, 300.0, SESSION):  # within the session it is the model's own
        hold = HoldConditions(time=np.array([time]))
        expected = own.model.correct(reading, own.parameters, own.gravity, hold)
        np.testing.assert_allclose(own.correct(reading, hold), expected, atol=1e-12)


def test_what_depends_on_the_position_before_is_left_and_said():
    values = {"h_x": 5e-3, "h_y": -2e-3}
    own, rows = calibrated("hysteresis", values), rows_of("hysteresis", values)
    table, (warning,) = leveled_rows(own, rows)
    assert "hysteresis is not corrected (h_x = 4.9" in warning
    nine = replace(own, model=NINE, parameters=own.parameters[: NINE.n_parameters])
    np.testing.assert_allclose(calibrated_in(table), nine.correct(rows[AXES]), atol=1e-9)


@pytest.mark.parametrize(("effects", "values"), [
    ("base_tilt", {"tilt_a": 5e-3, "tilt_b": -3e-3}),
    ("encoder_scale", {"e_roll": 1e-3, "e_pitch": -1e-3}),
    ("mounting_rotation", {"eps_x": 0.01, "eps_y": -0.02, "eps_z": 0.015}),
])  # fmt: skip
def test_the_sensor_takes_along_what_is_its_own(effects, values):
    """What the rig had is left with it; the rotation against the flange is taken along."""
    own = values if effects == "mounting_rotation" else {}
    known = dict(zip(get_model(effects).parameter_names, values.values(), strict=True))
    taken = calibrated(effects, known, "robot")
    assert {name for name in known if name in taken.model.parameter_names} == set(own)
    table, warnings = leveled_rows(taken, rows_of("mounting_rotation", own), sigma=0.0)
    assert_leveled(table)
    assert warnings == []


def test_a_log_in_other_axes_is_leveled_in_them():
    values = {"b_T_x": 2e-3, "b_T_y": -3e-3}
    own = calibrated("thermal_bias", values)
    rows = rows_of("thermal_bias", values, temperature=np.linspace(16, 34, 40))
    frd, frame = leveled_rows(own, rows)[0], parse_frame("rfu")
    # As counts, whose scale and offset belong to the axes of the log.
    scale, offset = np.array([0.01, 0.02, 0.005]), np.array([5.0, 6.0, 7.0])
    rows[AXES] = frame.from_frd(rows[AXES]) / scale + offset
    layout = LogLayout(unit="counts", scale=[*scale], offset=[*offset], frame="rfu")
    table, _ = leveled_rows(with_keys(own, log=layout), rows)
    turned = frame.from_frd(calibrated_in(frd))
    np.testing.assert_allclose(calibrated_in(table), turned, atol=1e-8)
    for sign, angle in zip(frame.signs, ("roll", "pitch"), strict=False):
        np.testing.assert_allclose(table[f"{angle}_gon"], sign * frd[f"{angle}_gon"], atol=1e-6)
    np.testing.assert_allclose(sigmas_in(table), sigmas_in(frd), atol=1e-6)


def test_a_single_reading_is_as_noisy_as_within_the_holds():
    noisy = calibrated("thermal_bias", {}, sd=np.full((30, 3), 0.05))
    rows = rows_of("thermal_bias", {}, temperature=np.full(40, 20.0))
    for own, sigma in ((noisy, 0.05), (calibrated("thermal_bias", {}), SIGMA)):
        default, given = (leveled_rows(own, rows, **more)[0] for more in ({}, {"sigma": sigma}))
        np.testing.assert_allclose(sigmas_in(default), sigmas_in(given), rtol=0.05)


def test_what_the_calibration_did_not_see_is_counted():
    rows = pd.DataFrame({"fx": 0.1, "fy": [0.1, 12.5, 0.2, 0.1], "fz": -9.8, "temperature": 20.0})
    rows.loc[2:, "temperature"] = [36.0, 60.0]  # the first is within the margin
    for effect, end in (("thermal_bias", "extrapolated there"), ("cubic_scale", "depends on it")):
        _, (warm, strong) = leveled_rows(calibrated(effect, {}), rows)
        assert warm.startswith("temperature outside the range of the calibration in 1 of 4 rows")
        assert "up to 60 °C" in warm
        assert warm.endswith(end)
    assert "force outside the range of the calibration in 1 of 4 rows: up to 12.5 m/s² r" in strong


def test_a_calibration_that_no_sensor_has_is_not_applied_without_a_word(plain):
    quality = {"plausible": False, "warnings": ["s_y is beyond"], "state": "implausible"}
    content = {**plain.document.model_dump(), "log": None, "quality": quality}
    doubtful = Calibration(None, content).sensor
    _, warnings = leveled_rows(doubtful, mixed_log()[AXES])
    assert "do not use this calibration: s_y is beyond" in warnings


# --- Logs ----------------------------------------------------------------------------------------

N = 20


def mixed_log():
    """Columns whose first rows look like other types than the whole."""
    forces = np.random.default_rng(1).normal(0, 5, (N, 3)).round(4)
    return pd.DataFrame(
        {
            "fx": [9, *forces[1:, 0]],
            "note": ["1", "2", *[""] * (N - 4), "3", 'late, "quoted" é'],
            "fy": forces[:, 1],
            "count": np.arange(N),
            "gap": [1, 2, *[None] * (N - 3), 4],
            "fz": forces[:, 2],
            "still": np.arange(N) % 2 == 0,
            "big": [1, *[2**63 + 5] * (N - 1)],
            "never": [None] * N,
            "sparse": [True, *[None] * (N - 1)],
        }
    )


def test_a_log_is_written_with_all_its_cells(plain, tmp_path):
    """What the log had is written as it was; a column of the same name is replaced."""
    log = tmp_path / "log.csv"
    mixed_log().assign(roll_gon=0.0).to_csv(log, index=False)
    leveled = level_log(plain, log, tmp_path / "out/level.csv")
    assert (len(leveled.added), leveled.lost.sum()) == (N, 0)
    text = {"dtype": str, "keep_default_na": False}
    found = pd.read_csv(tmp_path / "out/level.csv", **text)
    pd.testing.assert_frame_equal(found[[*mixed_log()]], pd.read_csv(log, **text)[[*mixed_log()]])
    forces = mixed_log()[["fx", "fy", "fz"]].to_numpy(float)
    angles, sigmas = plain.level(forces, plain.document.sigma_position_mps2)
    expected = np.column_stack(
        [plain.correct(forces), np.stack([angles / GON, sigmas / MGON], -1).reshape(N, 4)]
    )
    assert set(found["near_pole"]) == {"false"}
    angles = ["roll_gon", "sigma_roll_mgon", "pitch_gon", "sigma_pitch_mgon"]
    added = found[[*calibrated_in(found), *angles]].astype(float)
    np.testing.assert_allclose(added, expected, atol=1e-9)


def test_parquet_keeps_its_types(plain, tmp_path):
    log = pa.table(
        {
            "fx": pa.array([1, 2], pa.int16()),
            "fy": pa.array([1.5, 2.5], pa.float32()),
            "fz": pa.array([9.0, 9.5]),
            "n": pa.array([1, None], pa.uint8()),
            "when": pa.array([0, 1], pa.timestamp("ns")),
        }
    )
    pq.write_table(log, tmp_path / "log.parquet")
    level_log(plain, tmp_path / "log.parquet", tmp_path / "out.parquet")
    assert pq.read_table(tmp_path / "out.parquet").select(log.column_names).equals(log)
    level_log(plain, tmp_path / "log.parquet", tmp_path / "out.csv")
    text = (tmp_path / "out.csv").read_text(encoding="utf-8").splitlines()
    assert text[1].startswith("1,1.5,9,1,1970-01-01 00:00:00.000000000,")
    assert text[2].startswith("2,2.5,9.5,,1970-01-01 00:00:00.000000001,")


def test_a_lost_sample_does_not_lose_the_log(plain, tmp_path):
    log = tmp_path / "log.csv"
    rows = [
        "1,2,9,a", "# a comment", "1,2,,b", "1,2,nan,c", "1,2", "1,2,9,d,1,2,9", "1,-,9,e",
        "1,2,9,f",
    ]  # fmt: skip
    log.write_text("fx,fy,fz,note\n" + "\n".join(rows) + "\n", encoding="utf-8")
    leveled = level_log(plain, log, tmp_path / "out.csv")
    found = pd.read_csv(tmp_path / "out.csv", dtype=str, keep_default_na=False)
    assert (len(leveled.added), leveled.lost.sum()) == (7, 5)
    assert found["roll_gon"].map(bool).tolist() == [True, *5 * [False], True]
    # A row with too few or too many cells has none: nobody knows which are right.
    assert found["note"].tolist() == ["a", "b", "c", "", "", "e", "f"]
    (warning,) = leveled.warnings
    assert warning.startswith("5 of 7 rows have no calibrated force")
    assert "line 4, column fz (fz): nothing" in warning
    log.write_text("fx,fy,fz,note\n1,2,9,a\n1,2\n", encoding="utf-8")
    (warning,) = level_log(plain, log, tmp_path / "out.csv").warnings
    assert warning.endswith("line 3, column fz (fz): the line ends before it")


@pytest.mark.parametrize("wanted", ["out.csv.gz", "out.pq"])
def test_a_log_without_names_is_written_with_places(plain, tmp_path, wanted):
    """The layout of the campaign's log is that of this one, unless another is given."""
    log = tmp_path / "log.csv"
    forces = mixed_log()[AXES].to_numpy(float)
    np.savetxt(log, np.column_stack([forces, np.full(N, 5)]), "%.4f", delimiter=";")
    given = {"columns": {"fx": 0, "fy": "1", "fz": 2}}
    known = with_keys(plain, log=LogLayout(**given, rate=100))
    for calibration, *options in ((plain, given), (known,)):
        level_log(calibration, log, tmp_path / wanted, *options)
        read = pd.read_csv if ".csv" in wanted else pd.read_parquet
        found = read(tmp_path / wanted)
        assert [*found][:4] == [f"column_{i}" for i in range(4)]
        np.testing.assert_array_equal(found[["column_0", "column_1", "column_2"]], forces)
        np.testing.assert_allclose(calibrated_in(found), plain.correct(forces), atol=1e-9)


def test_a_reading_at_the_end_of_the_range_is_no_measurement(plain, tmp_path):
    """A sensor that clips has no force for the readings that it clipped."""
    values = {"k_sat_x": 1.0, "k_sat_y": 1.0, "k_sat_z": 1.0}
    model = get_model("bias-scale-nonorthogonality+saturation(knee=9)")
    clipping = replace(
        plain, model=model, parameters=model.vector(values), covariance=np.zeros((12, 12))
    )
    ranged = with_keys(plain, range_mps2=9.05)
    (tmp_path / "log.csv").write_text("fx,fy,fz\n0,0,-9.05\n1,5,-8\n", encoding="utf-8")
    for known in (clipping, ranged):
        leveled = level_log(known, tmp_path / "log.csv", tmp_path / "out.csv")
        assert (len(leveled.added), leveled.lost.sum()) == (2, 1)
        (warning,) = leveled.warnings
        assert "line 2: the calibration has no force for such a reading" in warning
        assert ("± 9.05 m/s²" in warning) == (known is ranged)
        with refused("no row can be corrected; the first: row 1: the calibration has no force"):
            level(known, pd.DataFrame([[0, 0, -9.05]], columns=["fx", "fy", "fz"]))
