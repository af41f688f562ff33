"""What logs look like elsewhere: clocks, axes, several sensors or files, holds mended by hand."""

import numpy as np
import pytest
from calling import refused, succeed
from log_helpers import RATE, G, open_log, session, table, write
from places import DATA, needs_data

import accelstudy as acs
from accelstudy.basics.units import GON, MGON
from accelstudy.campaign.format import read_campaign
from accelstudy.campaign.header import LogLayout
from accelstudy.campaign.importing import segmentation_figure
from accelstudy.campaign.importing.logs import import_log
from accelstudy.campaign.importing.public import import_settings, public_file
from accelstudy.campaign.importing.settings import ImportSettings
from accelstudy.campaign.log_import import files_of
from accelstudy.leveling.angles import specific_force
from accelstudy.sensors.frames import parse_frame

SINCE_1970 = {"s": 1.7e9, "ms": 1.7e12, "us": 1_700_000_000_123_456, "ns": 17 * 10**17 + 1}
PER_SECOND = {"s": 1, "ms": 10**3, "us": 10**6, "ns": 10**9}


@pytest.fixture(scope="module")
def turned():
    """A session of 8 holds, and their edges."""
    return session()


# --- Clocks --------------------------------------------------------------------------------------


@pytest.mark.parametrize("unit", SINCE_1970)
@pytest.mark.parametrize("kind", ["csv", "csv.gz", "parquet"])
def test_times_since_1970(tmp_path, turned, unit, kind):
    forces, _ = turned
    ticks = np.arange(len(forces)) / RATE * PER_SECOND[unit]
    whole = ticks.astype(np.int64) if unit in ("us", "ns") else ticks
    log, path = table(forces, time=whole + SINCE_1970[unit]), tmp_path / f"log.{kind}"
    (log.to_parquet if kind == "parquet" else log.to_csv)(path, index=False)
    log = open_log(path, time_unit=unit)
    np.testing.assert_allclose(log.time, ticks / PER_SECOND[unit], atol=1e-6)
    assert 1 / log.step == pytest.approx(RATE, rel=1e-4)


def test_the_rate_is_that_of_the_samples(tmp_path, turned):
    """Most steps are a tick too long, some much too short, and there is a gap."""
    forces, _ = turned
    rng = np.random.default_rng(1)
    steps = np.where(rng.random(len(forces)) < 0.8, 0.0112, 0.0052)
    time = np.cumsum(steps)
    time[len(time) // 2 :] += 500
    path = write(tmp_path, forces, time)
    assert open_log(path).step == pytest.approx(np.mean(steps), rel=1e-3)
    campaign = acs.find_holds(path)
    assert any("1 gap in time" in text for text in campaign.warnings)
    assert campaign.n_positions in (8, 9)


# --- Axes, units, conditions ---------------------------------------------------------------------


@pytest.mark.parametrize("unit", ["m/s^2", "counts"])
def test_frames(turned, unit):
    """A log in other axes makes the same campaign; numbers with a scale are and stay counts."""
    forces, _ = turned
    raw, how = parse_frame("flu").from_frd(forces), {"rate": RATE, "frame": "FLU"}
    if unit == "counts":
        raw = raw / [0.001, 0.002, 0.003] + [100.0, 200.0, 300.0]
        how |= {"scale": "0.001,0.002,0.003", "offset": "100,200,300"}
    found = acs.find_holds(table(raw), **how)
    assert any("axes: flu in the log" in note for note in found.notes)
    expected = acs.find_holds(table(forces), rate=RATE)
    np.testing.assert_allclose(found.forces, expected.forces, rtol=1e-9)
    np.testing.assert_allclose(found.sd, expected.sd, rtol=1e-9)
    assert found.header.log.frame == "flu"
    assert found.header.unit == unit
    if unit == "counts":
        np.testing.assert_array_equal(found.header.nominal.scale, [0.001, -0.002, -0.003])


def test_temperature_vibration_and_range(turned):
    forces, edges = turned
    n = len(forces)
    # The thermometer is slower than the accelerometer.
    warm = np.where(np.arange(n) % 10 == 0, np.linspace(10, 20, n), np.nan)
    limit = 0.97 * np.abs(forces[edges[0, 0] : edges[0, 1]].mean(axis=0)).max()
    how = {"rate": RATE, "columns": "vibration=shake", "range": f"{limit / 9.80665:.6f}g"}
    campaign = acs.find_holds(table(forces, temp=warm, shake=0.3), **how)
    said = " ".join(campaign.warnings)
    assert "left out: the sensor is saturated there" in said
    assert campaign.header.range_mps2 == pytest.approx(limit, rel=1e-5)
    assert campaign.n_positions < len(edges)
    expected = 10 + 10 * campaign.time * RATE / (n - 1)
    np.testing.assert_allclose(campaign.temperature, expected, atol=0.05)
    np.testing.assert_allclose(campaign.vibration, 0.3)
    warm[edges[1, 0] : edges[1, 1]] = np.nan
    campaign = acs.find_holds(table(forces, temp=warm), rate=RATE)
    assert campaign.temperature is None
    assert any("hold 2 has no temperature" in text for text in campaign.warnings)


@needs_data
def test_sigma_does_not_depend_on_the_offset():
    path, settings = public_file("xsens-mti", DATA), import_settings("xsens-mti")
    right, sigmas = [33124, 33275, 32365], []
    for offset in (None, [32768], right):
        campaign, holds = import_log(path, settings.model_copy(update={"offset": offset}))
        sigmas.append(campaign.sigma_force)
        assert holds.noise.directed
        np.testing.assert_allclose(np.linalg.norm(campaign.forces, axis=1), 9.8, atol=2)
        if offset is None:
            np.testing.assert_allclose(campaign.header.nominal.offset, right, atol=10)
            assert any("from the positions, as none was given" in note for note in campaign.notes)
    np.testing.assert_allclose(sigmas, sigmas[0], rtol=0.01)


def test_a_range_that_is_not_known_is_asked_for_where_holds_are_saturated(turned):
    """`apply` takes no reading for saturated without it."""
    forces, edges = turned
    limit = max(np.abs(forces[first:end].mean(axis=0)).max() for first, end in edges)
    clipped = np.clip(forces, -limit, limit)  # half of the samples of a hold
    for full_range in (None, limit):
        campaign = acs.find_holds(table(clipped), rate=RATE, range=full_range)
        said = " ".join(campaign.warnings)
        assert "left out: the sensor is saturated there" in said
        assert ("with a `range`, `apply` leaves" in said) == (full_range is None)


# --- What was never still ------------------------------------------------------------------------


def test_a_machine_that_hums_is_still():
    rng = np.random.default_rng(1)
    hum = 2 * np.sin(2 * np.pi * 29.3 * np.arange(9000) / RATE)[:, None] * [1, 0.3, 0.5]
    forces = [0, 0, -G] + hum + 0.02 * rng.standard_normal((9000, 3))
    assert acs.find_holds(table(forces), rate=RATE).n_positions == 1


def moved(turn, size, cut):
    """Forces where a sensor turns about its y axis, rad/s, and is shaken below a frequency, Hz."""
    rng, n = np.random.default_rng(1), 9000
    angle, frequency = turn * np.arange(n) / RATE, np.fft.rfftfreq(n, 1 / RATE)
    turning = G * np.column_stack([np.sin(angle), 0 * angle, -np.cos(angle)])
    spectrum = np.fft.rfft(rng.standard_normal((n, 3)), axis=0)
    spectrum[(frequency > cut) | (frequency == 0)] = 0
    shaken = np.fft.irfft(spectrum, n, axis=0)
    return turning + size * shaken / shaken.std() + 0.02 * rng.standard_normal((n, 3))


@pytest.mark.parametrize(("turn", "size", "cut"), [
    (0.5, 4.0, 3),  # waved about
    (0.1, 0.4, 2),  # turned gently by hand
    (0.02, 0.0, 1),  # on a turntable
    (0.0, 2.0, 3),  # carried upright
])  # fmt: skip
def test_a_sensor_that_moves_all_the_time_was_never_still(turn, size, cut):
    with refused("the sensor was never still: "):
        acs.find_holds(table(moved(turn, size, cut)), rate=RATE)


# --- Holds by hand -------------------------------------------------------------------------------


def test_holds_are_left_out_by_number(tmp_path, turned):
    forces, _ = turned
    path = write(tmp_path, forces)
    excluded = ("--exclude", "2:moved", "--exclude", "7:somebody passed")
    result = succeed(
        "import", path, "--out", tmp_path / "out", "--rate", 100, *excluded, "--no-figure"
    )
    assert "left out: 2 holds: 2 (moved), 7 (somebody passed)" in result.stdout
    campaign = read_campaign(tmp_path / "out")
    assert campaign.positions.tolist() == [1, 3, 4, 5, 6, 8]
    assert campaign.reasons == {2: "moved", 7: "somebody passed"}
    assert len(campaign.holds) == 8
    settings = ImportSettings(rate=100, exclude=[*excluded[1::2]])
    figure = segmentation_figure.draw_segmentation(import_log(path, settings)[1])
    assert "2 left out" in [text.get_text() for text in figure.legends[0].get_texts()]


# --- Several files -----------------------------------------------------------------------------


@pytest.mark.parametrize("clock", ["one", "each", "rate"])
def test_one_file_per_position(tmp_path, turned, clock):
    """Each has a moving start and end; the third has nothing else."""
    forces, edges = turned
    folder = tmp_path / "positions"
    folder.mkdir()
    for i, (start, end) in enumerate(edges[:5]):
        piece = slice(start - 100, end + 100) if i != 2 else slice(start - 100, start + 60)
        time = np.arange(len(forces))[piece] / RATE
        clocks = {"one": {"t": time}, "each": {"t": time - time[0]}, "rate": {}}
        table(forces[piece], **clocks[clock]).to_csv(folder / f"pos{9 + i}.csv", index=False)
    files = files_of([folder])
    assert [path.name for path in files] == [f"pos{9 + i}.csv" for i in range(5)]
    assert files_of(sorted(folder.iterdir())) == files == files_of([folder / "pos*.csv"])
    campaign = acs.find_holds(folder, rate=100 if clock == "rate" else None)
    assert campaign.positions.tolist() == [1, 2, 4, 5]
    assert "5, with the longest hold of each as one position" in campaign.notes[2]
    assert (campaign.time is not None) == (clock == "one")
    assert campaign.name == "positions"
    assert not any("gap" in text for text in campaign.warnings)
    assert f"{files[2]}: no static hold; position 3 is missing" in campaign.warnings
    middles = edges[[0, 1, 3, 4]].mean(axis=1)
    if clock == "one":
        np.testing.assert_allclose(np.diff(campaign.time), np.diff(middles) / RATE, atol=0.1)
    expected = [forces[a:b].mean(axis=0) for a, b in edges[[0, 1, 3, 4]]]
    np.testing.assert_allclose(campaign.forces, expected, atol=0.01)


# --- Means with a robot --------------------------------------------------------------------------


@pytest.mark.parametrize(("frame", "unit"), [("frd", "gon"), ("flu", "deg"), ("flu", "rad")])
def test_means_with_a_robot(frame, unit):
    roll, pitch, yaw = np.random.default_rng(1).uniform(-60, 60, (3, 12)) * GON
    forces = np.column_stack(specific_force(roll, pitch, G))
    axes = parse_frame(frame)
    size = {"gon": GON, "deg": np.pi / 180, "rad": 1.0}[unit]
    names = zip(("roll", "pitch", "yaw"), (roll, pitch, yaw), axes.signs, strict=True)
    angles = {name: sign * angle / size for name, angle, sign in names}
    log, how = table(axes.from_frd(forces), **angles), {"means": True, "frame": frame}
    campaign = acs.find_holds(log, robot_sigma="3.2mgon", robot_unit=unit, **how)
    np.testing.assert_allclose(campaign.angles, np.column_stack([roll, pitch]), atol=1e-12)
    np.testing.assert_allclose(campaign.yaw, yaw, atol=1e-12)
    assert campaign.header.sigma_angle == pytest.approx(3.2 * MGON)
    # Of a log it tells the axes, and not the columns.
    assert campaign.header.log == LogLayout(frame=frame)
    np.testing.assert_allclose(campaign.forces, forces, atol=1e-12)
    wrong, right = "rad" if unit != "rad" else "gon", {"deg": "degrees", "rad": "radians"}
    with refused(f"the robot's angles are in {right.get(unit, unit)}, not in {wrong}"):
        acs.find_holds(log, robot_sigma="3.2mgon", robot_unit=wrong, **how)
    said = " ".join(acs.find_holds(log, **how).warnings)
    assert "`robot_sigma` takes them for the robot's" in said
