"""Logs as people and loggers write them: each is read, and gives the parameters of its sensor."""

import io
import os
import zipfile
from itertools import product

import numpy as np
import pandas as pd
import pytest
from calling import refusal, succeed
from recorded import write_bag, write_ulog

import accelstudy as acs
from accelstudy.campaign.importing.opening import open_source

G = 9.80665
BIAS = np.array([0.120, -0.080, 0.200])  # m/s²
SCALE = np.array([0.004, -0.003, 0.006])
SIGMA = 0.02  # m/s², of a sample
RATE, HOLD, MOVE = 50, 3.0, 1.0


def directions():
    """Faces and corners of a cube."""
    faces, corners = (
        np.concatenate([np.eye(3), -np.eye(3)]),
        np.array([*product((-1, 1), repeat=3)]),
    )
    return np.concatenate([faces, corners / np.sqrt(3)])


def session():
    """Times and readings of a sensor that is turned by hand into 14 positions."""
    rng, rows = np.random.default_rng(7), []
    for direction in directions():
        force = (1 + SCALE) * G * direction + BIAS
        rows.append(force + rng.normal(0, 3.0, (int(MOVE * RATE), 3)))
        rows.append(force + rng.normal(0, SIGMA, (int(HOLD * RATE), 3)))
    forces = np.concatenate(rows).round(4)
    return np.arange(len(forces)) / RATE, forces


TIME, FORCES = session()
N, HOLDS = len(TIME), len(directions())
IN_HOLD = 130  # a row in the middle of the first hold, whose move has 50


def table(time=TIME, forces=FORCES, names=("t", "ax", "ay", "az"), **more):
    return pd.DataFrame(dict(zip(names, (time, *forces.T), strict=True))).assign(**more)


def rows_of(frame, **options):
    return frame.to_csv(index=False, **options).splitlines()


def written(folder, lines, name="log.csv", encoding="utf-8"):
    path = folder / name
    path.write_text("\n".join(lines) + "\n", encoding=encoding)
    return path


def found(log, **settings):
    """Campaign of a log that has all positions, and the parameters of the sensor."""
    campaign = acs.find_holds(log, gravity=G, **settings)
    assert campaign.n_positions == HOLDS
    value = acs.calibrate(campaign, model="bias-scale").parameters["value"]
    # The mean of some 100 samples is known to 2 mm/s².
    np.testing.assert_allclose([value[f"b_{axis}"] for axis in "xyz"], BIAS, atol=0.004)
    np.testing.assert_allclose([value[f"s_{axis}"] for axis in "xyz"], SCALE, atol=6e-4)
    return campaign


def said(campaign):
    return " | ".join([*campaign.notes, *campaign.warnings])


# --- The delimiter -------------------------------------------------------------------------------


def test_notes_do_not_tell_the_delimiter(tmp_path):
    """A number in a note above a tab table with columns that are mostly empty."""
    frame = table(gps=[None] * N, note=[None] * N)
    lines = ["// Sampled at 50 Hz by 3 axes on 1 board in 26 positions", *rows_of(frame, sep="\t")]
    lines[IN_HOLD] += "12.5"
    path = written(tmp_path, lines)
    assert "forces from ax, ay, az" in said(found(path))
    notes = ["# 1 2 3 4 5", "; 1 2 3 4 5 6 7", "% 1, 2, 3, 4, 5, 6"] * 500
    assert "forces from ax, ay, az" in said(found(written(tmp_path, [*notes, *lines])))


def test_a_note_of_words_and_numbers_leaves_tabs_the_delimiter(tmp_path):
    """Blanks gave a number more a row, of "say, 0"."""
    path = written(tmp_path, rows_of(table(note=["say, 0"] * N), sep="\t"))
    assert "forces from ax, ay, az" in said(found(path))


@pytest.mark.parametrize("delimiter", ["|", "tab", ";"])
def test_a_delimiter_can_be_given(tmp_path, delimiter):
    path = written(tmp_path, rows_of(table(), sep="\t" if delimiter == "tab" else delimiter))
    found(acs.read_log(path, delimiter=delimiter))
    succeed("import", path, "--delimiter", delimiter, "--no-figure", "--out", tmp_path / "out")
    acs.calibrate(acs.read_campaign(tmp_path / "out")).save(tmp_path / "calibrated")
    document = tmp_path / "calibrated/calibration.json"
    options = ("--delimiter", delimiter, "--out", tmp_path / "level.csv")
    assert f"{N} of {N} rows leveled" in succeed("apply", document, path, *options).stdout


@pytest.mark.parametrize("delimiter", ["", "ab", "1", ".", '"', "\n", "é"])
def test_what_is_no_delimiter_is_refused(tmp_path, delimiter):
    path = written(tmp_path, rows_of(table()))
    assert "delimiter" in refusal("import", path, "--delimiter", delimiter, "--out", tmp_path / "o")


# --- Rows without a reading ----------------------------------------------------------------------


@pytest.mark.parametrize("value", ["1e8", "-2147483648", "3.4e38"])
def test_an_absurd_reading_is_a_missing_one(tmp_path, value):
    """Running sums over a chunk lost their digits: 8 of 26 holds, and no word."""
    lines = rows_of(table())
    lines[21] = f"{TIME[20]},{FORCES[20, 0]},{value},{FORCES[20, 2]}"  # while it was turned
    campaign = found(written(tmp_path, lines))
    assert f"1 of {N} rows left out, as a reading is missing or absurd" in said(campaign)
    assert f"line 22, column ay (fy): '{value}'" in said(campaign)


def test_a_large_reading_costs_no_digits():
    """A reading of 900 g in a chunk of a sensor with noise of 1 µm/s²."""
    from accelstudy.campaign.importing.windows import window_variance

    rng = np.random.default_rng(2)
    forces = rng.normal(0, 1e-6, (60_000, 3)) + np.array([0, 0, G])
    expected, _ = window_variance(forces[-2000:], 101)
    forces[100, 0] = 9000.0
    np.testing.assert_allclose(
        window_variance(forces, 101)[0][-len(expected) :], expected, rtol=1e-3
    )


def test_rows_without_a_number_are_gaps(tmp_path):
    """Every two-hundredth row of a log lacked a reading, for which all of it was refused."""
    lines = rows_of(table(speed=3.5))
    for i in range(150, N, 200):
        cells = lines[i].split(",")
        cells[1 + i // 200 % 3] = ("", "n/a", "---", "1.2.3")[i // 200 % 4]
        lines[i] = ",".join(cells)
    campaign = found(written(tmp_path, lines))
    count = len(range(150, N, 200))
    assert f"{count} of {N} rows left out" in said(campaign)
    assert all(f"line {i + 1}, column" in said(campaign) for i in (150, 350, 550))
    assert "not used: speed" in said(campaign)


def test_a_gap_keeps_the_clock_and_the_blocks(tmp_path):
    """A row that is left out is a sample all the same: where there is a rate, and in a block."""
    lines = rows_of(table()[["ax", "ay", "az"]])
    for i in range(60, N, 50):
        lines[i] = "nan,nan,nan"
    campaign = found(written(tmp_path, lines), rate=RATE)
    middles = (MOVE + HOLD) * np.arange(HOLDS) + MOVE + HOLD / 2
    np.testing.assert_allclose(campaign.time, middles, atol=0.1)
    still = np.tile(np.arange(200) >= 50, HOLDS)
    found(written(tmp_path, [lines[0], *np.array(lines[1:])[still], "end of log,,"]), block=150)


def test_sensors_of_one_log_lose_the_same_rows(tmp_path):
    more = dict(zip(("bx", "by", "bz"), FORCES.T, strict=True))
    lines = rows_of(table(**more))
    lines[300] = lines[300].rsplit(",", 1)[0] + ",x"
    path = written(tmp_path, lines)
    sensors = ("--sensor", "a=ax,ay,az", "--sensor", "b=bx,by,bz")
    text = succeed("import", path, *sensors, "--no-figure", "--out", tmp_path / "out").stderr
    assert text.count("line 301, column bz") == 2
    one, two = (acs.read_campaign(tmp_path / "out" / name) for name in "ab")
    np.testing.assert_array_equal(one.forces, two.forces)


@pytest.mark.parametrize("trouble", ["note", "header", "units", "comments", "trailing", "first"])
def test_what_stands_around_the_rows(tmp_path, trouble):
    lines = rows_of(table())
    text = {"note": "1 of", "units": "units: in line 2", "trailing": "at the end of each row"}
    text |= {"header": "header stands 2 more times", "first": "line 2, column ax (fx): nothing"}
    if trouble == "note":
        lines += ["", "End of recording, 26 positions, all is well, goodbye, operator: N. N."]
    elif trouble == "header":
        lines = [*lines[:700], lines[0], *lines[700:900], lines[0], *lines[900:]]
    elif trouble == "units":
        lines = [lines[0], "s,m/s²,m/s²,m/s²", *lines[1:]]
    elif trouble == "comments":
        lines = ["; made by a logger, with 3 axes", *lines[:50], "; a pause", "// on", *lines[50:]]
    elif trouble == "trailing":
        lines[1:] = [f"{line}," for line in lines[1:]]
    else:
        lines[1] = "0.0,,,"
    path = written(tmp_path, lines)
    campaign = found(path)
    assert "time from t" in said(campaign)
    assert text.get(trouble, "columns") in said(campaign)
    table_of = acs.calibrate(campaign).apply(path)
    assert table_of["roll_gon"].notna().sum() == N - (trouble == "first")


# --- Names, units and dates ----------------------------------------------------------------------


@pytest.mark.parametrize(("names", "factor", "unit"), [
    (("Time [s]", "ax [m/s^2]", "ay [m/s^2]", "az [m/s^2]"), 1.0, "m/s^2"),
    (("Time (s)", "acc_x (g)", "acc_y (g)", "acc_z (g)"), 1 / G, "g"),
    (("t", "AccX_mg", "AccY_mg", "AccZ_mg"), 1e3 / G, "mg"),
    (("t", "Acceleration x (m/s²)", "Acceleration y (m/s²)", "Acceleration z (m/s²)"), 1, "m/s^2"),
])  # fmt: skip
def test_names_with_units(tmp_path, names, factor, unit):
    turns = {"x-axis (deg/s)": 0.1, "wx [rad/s]": 0.2}
    path = written(tmp_path, rows_of(table(forces=FORCES * factor, names=names, **turns)))
    campaign = found(path)
    assert f"({unit})" in said(campaign)
    assert campaign.unit == unit
    applied = acs.calibrate(campaign).apply(path)
    # Rows at rest have the length of gravity.
    norm = np.linalg.norm(applied[[f"f{a}_calibrated_mps2" for a in "xyz"]], axis=1)
    assert np.median(norm) == pytest.approx(G, rel=2e-3)


def test_milli_g_is_a_unit_and_others_are_suggested(tmp_path):
    path = written(tmp_path, rows_of(table(forces=FORCES * 1e3 / G)))
    assert "these look like mg, not m/s^2; give --unit mg" in refusal(
        "import", path, "--out", tmp_path / "o"
    )
    for unit in ("mg", "milli-g"):
        found(acs.read_log(path, unit=unit))
    names, *rows = rows_of(table(forces=FORCES * 1e3 / G))
    assert found(written(tmp_path, [names, "s,mg,mg,mg", *rows])).unit == "mg"


@pytest.mark.parametrize("name", [
    "Temp (C)", "Temperature [°C]", "imu_temp", "T_degC", "tempC", "sensorTemperature",
])  # fmt: skip
def test_a_temperature_by_any_usual_name(tmp_path, name):
    path = written(tmp_path, rows_of(table(**{name: 20 + TIME / 20})))
    campaign = found(path)
    np.testing.assert_allclose(campaign.temperature, 20 + campaign.time / 20, atol=0.01)
    assert f"temperature from {name}" in said(campaign)


@pytest.mark.parametrize("names", [("imu_temp", "cpu_temp"), ("Temp [K]",), ("temp (°F)",)])
def test_a_temperature_that_is_not_used_is_said(tmp_path, names):
    path = written(tmp_path, rows_of(table(**dict.fromkeys(names, 290.5))))
    campaign = found(path)
    assert campaign.temperature is None
    assert f"temperature: which of {', '.join(names)}, in °C?" in said(campaign)


START = pd.Timestamp("2024-01-31 23:58:59")


def clock_of(text):
    stamps = START + pd.to_timedelta(TIME, "s")
    return [f"{stamp:{text}}".replace("%", f"{stamp.microsecond // 1000:03d}") for stamp in stamps]


@pytest.mark.parametrize("text", [
    "%d.%m.%Y %H:%M:%S.%%", "%Y/%m/%d %H:%M:%S.%%", "%Y.%m.%d %H:%M:%S,%%", "%Y-%m-%d %H:%M:%S:%%",
])  # fmt: skip
def test_plain_dates(tmp_path, text):
    path = written(tmp_path, rows_of(table(time=clock_of(text)), sep=";"))
    campaign = found(path)
    np.testing.assert_allclose(np.diff(campaign.time), MOVE + HOLD, atol=0.1)


def test_a_clock_alone(tmp_path):
    stamps = pd.Timestamp("2024-01-31 09:58:59") + pd.to_timedelta(TIME, "s")
    times = [f"{stamp:%H:%M:%S}:{stamp.microsecond // 1000:03d}" for stamp in stamps]
    campaign = found(written(tmp_path, rows_of(table(time=times))))
    np.testing.assert_allclose(np.diff(campaign.time), MOVE + HOLD, atol=0.1)


@pytest.mark.parametrize("day", ["3/1/2024 10:00:00", "1492-01-01 10:00:00", "3021-01-01 10:00:00"])
def test_other_dates_end_in_a_line(tmp_path, day):
    frame = table(time=[f"{day}.{i:05d}" for i in range(N)]).rename(columns={"t": "time"})
    path = written(tmp_path, rows_of(frame))
    assert "--rate" in refusal("import", path, "--out", tmp_path / "out")


def test_years_that_do_not_fit_are_no_traceback(tmp_path):
    frame = table(time=np.datetime64("2999-01-01", "ms") + np.arange(N))
    frame.to_parquet(tmp_path / "log.parquet")
    assert "--rate" in refusal("import", tmp_path / "log.parquet", "--out", tmp_path / "out")


@pytest.mark.parametrize("index", ["dates", "zone", "durations"])
def test_a_table_in_memory_has_the_time_of_its_index(index):
    times = {"dates": START + pd.to_timedelta(TIME, "s"), "durations": pd.to_timedelta(TIME, "s")}
    times["zone"] = times["dates"].tz_localize("Europe/Berlin")
    frame = table()[["ax", "ay", "az"]].set_index(times[index])
    campaign = found(frame)
    np.testing.assert_allclose(np.diff(campaign.time), MOVE + HOLD, atol=0.1)
    by_place = acs.read_log(frame, columns={"fx": 0, "fy": 1, "fz": 2})
    assert len(acs.calibrate(found(by_place)).apply(by_place)) == N
    assert "time" not in acs.read_log(frame, rate=RATE).layout


# --- Files that are something else ---------------------------------------------------------------


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-be", "utf-8-sig"])
def test_utf_16_is_read(tmp_path, encoding):
    path = written(tmp_path, rows_of(table()), encoding=encoding)
    assert len(acs.calibrate(found(path)).apply(path)) == N


def packed(name):
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        archive.writestr(name, "text")
    return content.getvalue()


@pytest.mark.parametrize(("content", "says"), [
    (packed("log.csv"), "a zip archive; unpack it first"),
    (packed("[Content_Types].xml"), "an Excel workbook; save its sheet as CSV"),
    (packed("docProps/app.xml"), "an Excel workbook"),
    (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(500), "an Excel workbook"),
    (b'[{"ax": 1, "ay": 2}]', "JSON; save it as CSV"),
    (b'{"ax": [1, 2]}', "JSON"),
    (b"BZh91AY" + bytes(50), "packed by bzip2"),
])  # fmt: skip
def test_other_files_are_named(tmp_path, content, says):
    path = tmp_path / "log.csv"
    path.write_bytes(content)
    assert says in refusal("import", path, "--out", tmp_path / "out")


def test_a_pipe_is_refused(tmp_path):
    """What was read to recognise it was lost, and the rest was leveled without a word."""
    os.mkfifo(tmp_path / "pipe")
    line = refusal("import", tmp_path / "pipe", "--out", tmp_path / "out")
    assert "pipe" in line


# --- Recordings that end early -------------------------------------------------------------------


def test_a_flight_log_that_ends_early(tmp_path):
    path = tmp_path / "log.ulg"
    write_ulog(path, TIME, [FORCES], 20 + TIME / 20)
    whole = path.read_bytes()
    assert not open_source(path).warnings
    path.write_bytes(whole[: len(whole) // 2 + 5])
    text = succeed("import", path, "--no-figure", "--out", tmp_path / "out").stderr
    assert "the flight log ends early or is damaged: its samples are whole up to" in text
    assert acs.read_campaign(tmp_path / "out").n_positions in (6, 7)
    middle = len(whole) // 2
    path.write_bytes(whole[:middle] + b"\xff" * 300 + whole[middle + 300 :])
    assert "is damaged" in open_source(path).warnings[0]


def test_a_bag_with_fewer_messages_than_it_says(tmp_path):
    write_bag(tmp_path / "bag", TIME, {"/imu/data": FORCES})
    header = tmp_path / "bag/metadata.yaml"
    header.write_text(header.read_text().replace(f"message_count: {N}", f"message_count: {2 * N}"))
    log = acs.read_log(tmp_path / "bag")
    campaign = acs.find_holds(log, gravity=G)
    assert f"{N} of {2 * N} messages of /imu/data are there, up to {N / RATE:.1f} s" in said(
        campaign
    )
    leveled = acs.calibrate(campaign).apply(log)
    assert any(f"{N} of {2 * N} messages" in line for line in leveled.attrs["warnings"])
