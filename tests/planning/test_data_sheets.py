"""Data sheets: the sensors that come along, files of a user's, and what follows from them."""

import json
import math

import numpy as np
import pytest
from calling import refusal, succeed
from scipy import signal

from accelstudy.basics.units import STANDARD_GRAVITY
from accelstudy.campaign.importing.allan import pooled_deviation
from accelstudy.data_sheets import (
    QUANTITIES,
    DataSheet,
    data_sheet_names,
    get_data_sheet,
    parse_data_sheet,
    sheet_of_sigma,
)
from accelstudy.data_sheets.measured import sheet_of_allan, with_history
from accelstudy.data_sheets.sheet import FLICKER, flicker_change


@pytest.mark.parametrize("name", data_sheet_names())
def test_each_value_of_a_sensor_that_comes_along_has_its_source(name):
    sheet = get_data_sheet(name)
    assert sheet.name == name
    assert sheet.title
    assert sheet.source
    assert all(sheet.sources[quantity] for quantity in sheet.known_quantities)
    assert set(sheet.known_quantities) | set(sheet.unknown_quantities) <= set(QUANTITIES)
    assert 1e-6 < sheet.sigma_mean(10.0) < 0.01


def test_a_one_sided_density_is_sqrt_2_times_the_random_walk():
    # A mean over τ passes white noise of one-sided density n with the variance n²/(2τ).
    sheet = parse_data_sheet({"noise_density": "400 µg/√Hz"})
    assert sheet.sigma_mean(1.0) == pytest.approx(400e-6 * STANDARD_GRAVITY / math.sqrt(2))
    # STIM300: 0.06 m/s/√h is 1 mm/s² after one second.
    walk = parse_data_sheet({"velocity_random_walk": "0.06 m/s/sqrt(h)"})
    assert walk.sigma_mean(1.0) == pytest.approx(1e-3)


def test_averaging_lowers_white_noise_and_not_the_floor():
    sheet = DataSheet("s", velocity_random_walk=1e-3, bias_instability=1e-4)
    assert sheet.sigma_mean(1.0) == pytest.approx(math.hypot(1e-3, 0.664e-4), rel=1e-3)
    assert sheet.sigma_mean(1e6) == pytest.approx(0.664e-4, rel=1e-3)


def test_the_wander_of_the_bias_during_a_session_is_that_of_a_simulated_random_walk():
    rng = np.random.default_rng(5)
    tau, n, walk = 10.0, 40, 2e-5
    steps = 20
    path = np.cumsum(walk * np.sqrt(tau / steps) * rng.standard_normal((4000, n * steps)), axis=1)
    means = path.reshape(4000, n, steps).mean(axis=2)
    scatter = np.sqrt(np.mean(means.var(axis=1, ddof=1)))
    sheet = DataSheet("s", velocity_random_walk=1e-12, acceleration_random_walk=walk)
    assert sheet.sigma_mean(tau, n * tau) == pytest.approx(scatter, rel=0.05)
    assert sheet.sigma_mean(tau) < scatter / 3


def test_the_bias_changes_with_time_temperature_and_switching_on():
    sheet = DataSheet(
        "s", velocity_random_walk=1e-3, acceleration_random_walk=1e-5,
        bias_per_kelvin=1e-3, repeatability=5e-3,
    )  # fmt: skip
    assert sheet.bias_change(0.0) == 0
    assert sheet.bias_change(3600.0) == pytest.approx(6e-4)
    assert sheet.temperature_sigmas(10.0) == pytest.approx((1e-2, 0.0))
    assert sheet.bias_change(0.0, restarted=True) == pytest.approx(5e-3)


def test_flicker_noise_carries_the_bias_ever_farther():
    """Against the integral over its density, of two means of τ that begin m τ apart."""
    instability, tau = 2e-4, 50.0
    white = FLICKER * instability * math.sqrt(tau)
    f = np.geomspace(1e-9, 1e2, 2_000_001)
    mean = 2 * np.sinc(f * tau) ** 2 * instability**2 / (2 * np.pi * f)  # of ±f
    for m in (1, 3, 100):
        variance = np.trapezoid(mean * 4 * np.sin(np.pi * f * m * tau) ** 2, f)
        change = flicker_change(instability, white, m * tau)
        assert change == pytest.approx(math.sqrt(variance), rel=2e-3)
    # Next to each other two means differ by the Allan deviation; shorter ones by no less.
    beside = math.sqrt(2) * FLICKER * instability
    assert flicker_change(instability, white, tau) == pytest.approx(beside)
    assert flicker_change(instability, white, 1e-3) == pytest.approx(beside)
    far = flicker_change(instability, white, 1e9)
    assert far == pytest.approx(instability * math.sqrt((2 * math.log(2e7) + 3) / math.pi))
    sheet = DataSheet("s", velocity_random_walk=white, bias_instability=instability)
    assert sheet.bias_change(100 * tau) == flicker_change(instability, white, 100 * tau)
    assert sheet.bias_change(0.0) == 0


def test_a_nonlinearity_is_taken_as_a_parabola_or_a_cubic_of_the_same_deviation():
    sheet = parse_data_sheet({
        "position_sigma": "2mm/s2", "nonlinearity": "0.5%", "full_scale": "2g"
    })  # fmt: skip
    # The line of least largest deviation leaves the Chebyshev polynomial of that degree; 0.5 % of
    # 2 g is 0.01 g.
    for size, power in ((sheet.quadratic_scale, 2), (sheet.cubic_scale, 3)):
        curve = np.polynomial.Polynomial([0] * power + [size], domain=[-2, 2], window=[-2, 2])
        left = curve.convert(kind=np.polynomial.Chebyshev, domain=[-2, 2]).coef[power]
        assert left == pytest.approx(0.01)


def test_a_users_file_is_read(tmp_path):
    path = tmp_path / "my-sensor.yaml"
    path.write_text("noise_density: 100 ug/sqrt(Hz)\nbias_instability: 20 ug\n")
    assert get_data_sheet(str(path)).name == "my-sensor"


def test_a_sensor_of_which_only_the_noise_is_known_keeps_it_however_long_the_hold():
    sheet = sheet_of_sigma(0.002)
    assert sheet.sigma_mean(1.0) == sheet.sigma_mean(100.0, 1000.0) == 0.002


# --- from what was measured ----------------------------------------------------------------------


@pytest.fixture(scope="module")
def still_log(tmp_path_factory):
    """Ten minutes at rest with N = 1 mm/s²/√Hz and K = 0.05 mm/s²/√s."""
    rng, rate, n = np.random.default_rng(1), 20, 20 * 600
    walk = np.cumsum(5e-5 / np.sqrt(rate) * rng.standard_normal((n, 3)), axis=0)
    samples = [0.1, 0.2, -9.8] + 1e-3 * np.sqrt(rate) * rng.standard_normal((n, 3)) + walk
    path = tmp_path_factory.mktemp("still") / "still.csv"
    np.savetxt(path, samples, "%.6f", delimiter=",")
    return path


READ = ("--rate", "20", "--columns", "fx=0,fy=1,fz=2")


def test_white_noise_seldom_shows_another_and_a_random_walk_is_seen():
    rng, (n, step, walk), seen = np.random.default_rng(2), (20_000, 0.01, 0.3), []
    for _ in range(60):
        white, steps = rng.standard_normal((2, n, 3))
        white /= step**0.5
        both = white + np.cumsum(walk * step**0.5 * steps, axis=0)
        alone, found = (
            sheet_of_allan(pooled_deviation([x], step), "s", "s") for x in (white, both)
        )
        assert alone.velocity_random_walk == pytest.approx(1.0, rel=0.03)
        seen.append((
            alone.bias_instability is not None,
            alone.acceleration_random_walk is not None,
            found.acceleration_random_walk or 0.0,
        ))  # fmt: skip
    flicker, drift, found = np.transpose(seen)
    for count in (flicker.sum(), drift.sum()):
        assert count <= 60 * 0.1 + 3 * np.sqrt(60 * 0.1 * 0.9)
    assert found.mean() == pytest.approx(walk, abs=3 * found.std() / 60**0.5 + 0.05 * walk)


@pytest.mark.parametrize("corner", [0.05, 0.3, 0.5, 0.7])
def test_a_filter_of_the_sensor_hides_no_white_noise(corner):
    """Of a bandwidth in parts of half the rate; without a bias instability of that size."""
    rng, step = np.random.default_rng(4), 0.01
    white = rng.standard_normal((60_000, 3)) / step**0.5
    filtered = signal.lfilter(*signal.butter(2, corner), white, axis=0)
    sheet = sheet_of_allan(pooled_deviation([filtered], step), "s", "s")
    assert sheet.velocity_random_walk == pytest.approx(1.0, rel=0.1)
    assert sheet.sigma_mean(10.0) == pytest.approx(1 / 10**0.5, rel=0.1)


def test_a_log_at_rest_makes_a_data_sheet_that_can_be_read(still_log, tmp_path):
    out = tmp_path / "mine.yaml"
    succeed("data-sheet", still_log, *READ, "--out", out)
    sheet = get_data_sheet(str(out))
    assert sheet.velocity_random_walk == pytest.approx(1e-3, rel=0.05)
    assert sheet.acceleration_random_walk == pytest.approx(5e-5, rel=0.5)
    assert sheet.sigma_mean(10.0) == pytest.approx(math.hypot(1e-3 / 10**0.5, 9e-5), rel=0.05)
    assert "still.csv" in sheet.sources["velocity_random_walk"]
    assert "# repeatability:" in out.read_text(encoding="utf-8")
    assert "--force replaces it" in refusal("data-sheet", still_log, *READ, "--out", out)


def test_a_campaign_tells_the_noise_of_its_positions(still_log, tmp_path):
    succeed("import", still_log, *READ, "--out", tmp_path / "c", "--no-figure")
    succeed("data-sheet", tmp_path / "c", "--out", tmp_path / "mine.yaml")
    sheet = get_data_sheet(str(tmp_path / "mine.yaml"))
    assert sheet.position_sigma is not None
    assert get_data_sheet(str(tmp_path / "c")).position_sigma == pytest.approx(
        sheet.position_sigma, rel=1e-3
    )


def history(path, scatter, rate):
    """What a history.json says of three axes, SI and per year."""
    each = zip("xyz", scatter, rate, strict=True)
    parameters = [
        {"name": f"b_{axis}", "scatter": {"sd": sd}, "rate": {"per_year": of_year, "sigma": 0.0}}
        for axis, sd, of_year in each
    ]
    path.write_text(json.dumps({"schema_version": 1, "parameters": parameters}), encoding="utf-8")
    return path


def test_a_history_tells_drift_and_switch_on_scatter(tmp_path):
    """The change of the bias between two sessions of simulated sensors, rms over the axes."""
    rng = np.random.default_rng(9)
    scatter, rate, years = np.array([1e-3, 4e-3, 0.0]), np.array([2e-3, 0.0, -6e-3]), 0.7
    sheet = with_history(sheet_of_sigma(2e-3), history(tmp_path / "history.json", scatter, rate))
    one, other = scatter * rng.standard_normal((2, 20_000, 3))
    change = np.sqrt(np.mean((other + rate * years - one) ** 2))
    said = sheet.bias_change(years * 365.25 * 86400, restarted=True)
    assert said == pytest.approx(change, rel=0.01)
    assert "repeatability" in sheet.known_quantities
