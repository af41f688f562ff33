"""Logs as people, loggers and robots write them: each gives the parameters of its sensor."""

import struct
import sys
from datetime import UTC, datetime, timedelta, timezone

import numpy as np
import pandas as pd
import pytest
from calling import refusal, refused, succeed
from log_helpers import BIAS, HAND_RATE, HOLD, HOLDS, MOVE, SCALE, by_hand, found, open_log
from recorded import EPOCH, message, ulog, write_bag, write_ulog

import accelstudy as acs
from accelstudy.basics.units import GON
from accelstudy.basics.units import STANDARD_GRAVITY as G
from accelstudy.campaign.importing.formats import read_table
from accelstudy.leveling.angles import angles_of

TIME, FORCES = by_hand()
N = len(TIME)
IN_HOLD = 130  # a row in the middle of the first hold, whose move has 50
TEMPERATURE = 20 + TIME / 20
FLU = (1, -1, -1)  # signs of its axes in frd


def table(time=TIME, forces=FORCES, names=("t", "ax", "ay", "az"), **more):
    return pd.DataFrame(dict(zip(names, (time, *forces.T), strict=True))).assign(**more)


def rows_of(frame, **options):
    return frame.to_csv(index=False, **options).splitlines()


def written(folder, lines, name="log.csv", encoding="utf-8"):
    path = folder / name
    path.write_text("\n".join(lines) + "\n", encoding=encoding)
    return path


def said(campaign):
    return " | ".join([*campaign.notes, *campaign.warnings])


def assert_timed(campaign):
    """The middle of a hold is known to a window at its ends."""
    np.testing.assert_allclose(np.diff(campaign.time), MOVE + HOLD, atol=0.1)


# --- text ----------------------------------------------------------------------------------------

ROWS = rows_of(table())
NOTES = ["# 1 2 3 4 5", "; 1 2 3 4 5 6 7", "% 1, 2, 3, 4, 5, 6"] * 500
SPARSE = rows_of(table(gps=[None] * N, note=[None] * N), sep="\t")
SPARSE[IN_HOLD] += "12.5"
AROUND = {
    "note below": ([*ROWS, "", "End of recording, 26 positions, all is well, N. N."], "1 of"),
    "header again": ([*ROWS[:700], ROWS[0], *ROWS[700:900], *ROWS[0:1], *ROWS[900:]],
                     "header stands 2 more times"),
    "comma behind the names": ([ROWS[0] + ",", *ROWS[1:]], "forces from ax, ay, az"),
    "units": ([ROWS[0], "s,m/s²,m/s²,m/s²", *ROWS[1:]], "units: in line 2"),
    "units in mg": ([ROWS[0], "s,mg,mg,mg", *rows_of(table(forces=FORCES * 1e3 / G))[1:]], "(mg)"),
    "first row": ([ROWS[0], "0.0,,,", *ROWS[2:]], "line 2, column ax (fx): nothing"),
    "labels": (["I2C ready", *(f"t: {t}, ax: {x}, ay={y}, az = {z}\ngx: {y}, gy: {z}, gz: {x}"
                               for t, x, y, z in (row.split(",") for row in ROWS[1:]))],
               "forces from ax, ay, az"),
    # Neither numbers in notes nor the blanks of a column of words tell the delimiter.
    "notes above": ([*NOTES, "// 50 Hz by 3 axes on 1 board in 26 positions", *SPARSE],
                    "forces from ax, ay, az"),
    "commas in quotation marks": (rows_of(table().astype(str).map(lambda x: x.replace(".", ","))),
                                  "forces from ax, ay, az"),
    "words": (rows_of(table(note=["say, 0"] * N), sep="\t"), "forces from ax, ay, az"),
}  # fmt: skip


@pytest.mark.parametrize("case", AROUND)
def test_what_stands_around_the_rows(tmp_path, case):
    lines, part = AROUND[case]
    path = written(tmp_path, lines)
    campaign = found(path)
    assert "time from t" in said(campaign)
    assert part in said(campaign)
    if case in ("first row", "header again", "labels", "units"):
        leveled = acs.calibrate(campaign).apply(path)
        assert leveled["roll_gon"].notna().sum() == N - (case == "first row")


def test_a_gap_keeps_the_clock_and_the_blocks(tmp_path):
    """A row that is left out is a sample all the same: where there is a rate, and in a block."""
    lines = rows_of(table()[["ax", "ay", "az"]])
    for i in range(60, N, 50):
        lines[i] = "nan,nan,nan"
    campaign = found(written(tmp_path, lines), rate=HAND_RATE)
    middles = (MOVE + HOLD) * np.arange(HOLDS) + MOVE + HOLD / 2
    np.testing.assert_allclose(campaign.time, middles, atol=0.1)
    still = np.tile(np.arange(200) >= 50, HOLDS)
    found(written(tmp_path, [lines[0], *np.array(lines[1:])[still], "end of log,,"]), block=150)


# --- names, units and dates ----------------------------------------------------------------------


@pytest.mark.parametrize(("names", "factor", "unit"), [
    (("Time [s]", "ax [m/s^2]", "ay [m/s^2]", "az [m/s^2]"), 1.0, "m/s^2"),
    (("Time (s)", "acc_x (g)", "acc_y (g)", "acc_z (g)"), 1 / G, "g"),
    (("t", "AccX_mg", "AccY_mg", "AccZ_mg"), 1e3 / G, "mg"),
    (("t", "Acceleration x (m/s²)", "Acceleration y (m/s²)", "Acceleration z (m/s²)"), 1, "m/s^2"),
])  # fmt: skip
def test_names_with_units(names, factor, unit):
    turns = {"x-axis (deg/s)": 0.1, "wx [rad/s]": 0.2}
    log = table(forces=FORCES * factor, names=names, **turns)
    campaign = found(log)
    assert f"({unit})" in said(campaign)
    assert campaign.header.unit == unit
    applied = acs.calibrate(campaign).apply(log)
    # Rows at rest have the length of gravity.
    norm = np.linalg.norm(applied[[f"f{a}_calibrated_mps2" for a in "xyz"]], axis=1)
    assert np.median(norm) == pytest.approx(G, rel=2e-3)
    spelling = {"m/s^2": "m/s2", "g": "G", "mg": "milli-g"}[unit]
    layout = acs.read_log(log, unit=spelling, time_unit="sec").layout
    assert (layout.unit, layout.time_unit) == (unit, "s")


def test_names_of_a_western_windows_are_read(tmp_path):
    names = ("Zeit [s]", "Längs [m/s²]", "Quer [m/s²]", "Höhe [m/s²]")
    path = written(tmp_path, rows_of(table(names=names)), encoding="cp1252")
    columns = dict(zip(("fx", "fy", "fz"), names[1:], strict=True))
    assert "from Längs [m/s²], Quer" in said(found(path, time=names[0], columns=columns))


@pytest.mark.parametrize("name", [
    "Temp (C)", "Temperature [°C]", "imu_temp", "T_degC", "tempC", "sensorTemperature",
])  # fmt: skip
def test_a_temperature_by_any_usual_name(name):
    campaign = found(table(**{name: TEMPERATURE}))
    np.testing.assert_allclose(campaign.temperature, 20 + campaign.time / 20, atol=0.01)
    assert f"temperature from {name}" in said(campaign)


@pytest.mark.parametrize("names", [
    ("imu_temp", "cpu_temp"), ("Temp [K]",), ("temp (°F)",), ("temp_F",), ("imu_temp_raw",),
])  # fmt: skip
def test_a_temperature_that_is_not_used_is_said(names):
    campaign = found(table(**dict.fromkeys(names, 290.5)))
    assert campaign.temperature is None
    assert f"temperature: which of {', '.join(names)}, in °C?" in said(campaign)
    raw = table(**dict.fromkeys([*names, "temp"], -2950))
    assert "temperature" not in said(found(raw, columns={"temperature": "none"}))


@pytest.mark.parametrize(("prefix", "point", "seconds", "rest"), [
    ("", ".", "header.stamp.secs", "header.stamp.nsecs"),
    ("field.", ".", "field.header.stamp.secs", "field.header.stamp.nsecs"),
    (".", ".", ".header.stamp.sec", ".header.stamp.nanosec"),
    ("/imu/data/", "/", "/imu/data/header/stamp/sec", "/imu/data/header/stamp/nanosec"),
    ("", "_", "secs", "nsecs"),
])  # fmt: skip
def test_columns_of_ros_are_recognised(prefix, point, seconds, rest):
    whole = np.floor(TIME + 1e-9)
    columns = {
        f"{prefix}header{point}seq": np.arange(N),
        seconds: (EPOCH + whole).astype(int),
        rest: np.round((TIME - whole) * 1e9).astype(int),
        f"{prefix}angular_velocity{point}x": 0.0,
    }
    axes = [f"{prefix}linear_acceleration{point}{axis}" for axis in "xyz"]
    assert_timed(found(pd.DataFrame(columns | dict(zip(axes, FORCES.T, strict=True))), FLU))


START = pd.Timestamp("2024-01-31 23:58:59")


def stamps(zone=UTC, text="%Y-%m-%dT%H:%M:%S.%f%z"):
    start = datetime.fromtimestamp(EPOCH, UTC).astimezone(zone)
    return [(start + timedelta(seconds=float(t))).strftime(text) for t in TIME]


def plain(text, start=START):
    times = start + pd.to_timedelta(TIME, "s")
    return [f"{time:{text}}".replace("%", f"{time.microsecond // 1000:03d}") for time in times]


DATES = {
    "utc": stamps(),
    "Z": [text.replace("+0000", "Z") for text in stamps()],
    "zone": stamps(timezone(timedelta(hours=5, minutes=30))),
    "none": stamps(text="%Y-%m-%d %H:%M:%S.%f"),
    # A clock that is put back in the middle of the log: the zone tells it.
    "winter": [*stamps(timezone(timedelta(hours=2)))[:700],
               *stamps(timezone(timedelta(hours=1)))[700:]],
    "points": plain("%d.%m.%Y %H:%M:%S.%%"), "slashes": plain("%Y/%m/%d %H:%M:%S.%%"),
    "comma": plain("%Y.%m.%d %H:%M:%S,%%"), "colon": plain("%Y-%m-%d %H:%M:%S:%%"),
    "clock": plain("%H:%M:%S:%%", pd.Timestamp("2024-01-31 09:58:59")),
}  # fmt: skip


@pytest.mark.parametrize("case", DATES)
def test_dates_and_clocks_are_a_column_of_time(tmp_path, case):
    path = written(tmp_path, rows_of(table(time=DATES[case]), sep=";"))
    campaign = found(path)
    assert_timed(campaign)
    if case in ("utc", "comma"):
        assert acs.calibrate(campaign).apply(path)["t"].tolist() == DATES[case]
    if len(DATES[case][0]) > 23:
        assert open_log(path).starts[0] == pytest.approx(EPOCH, abs=1e-3)
        frame = table(time=pd.to_datetime(DATES[case], utc=True, format="ISO8601"))
        frame.to_parquet(tmp_path / "log.parquet")
        assert_timed(found(tmp_path / "log.parquet"))


@pytest.mark.parametrize("name", ["SN", "serial", "Serial No.", "Seriennummer", "sensor_id"])
def test_rows_of_several_sensors_are_refused(name):
    """Sensors that were logged together would be taken for one whose readings are their mean."""
    log = table().loc[lambda rows: rows.index.repeat(2)].assign(**{name: ["A7", "B2"] * N})
    for settings in ({}, {"rate": 2 * HAND_RATE}, {"means": True}):
        with refused(f"column {name} has A7, B2; give the rows of each"):
            acs.find_holds(log, **settings)
    for one in (log[log[name] == "B2"], table().assign(**{name: range(N)})):
        assert acs.find_holds(one).n_positions == HOLDS


def test_a_rate_that_the_times_contradict_is_told():
    dated = table(time=START + pd.to_timedelta(TIME, "s"))
    named = table(names=("t_ms", "ax", "ay", "az"), time=1e3 * TIME)
    for frame, name in ((dated, "t"), (named, "t_ms")):
        wrong, right = (acs.find_holds(frame, rate=rate) for rate in (60, HAND_RATE))
        assert f"column {name} tells 50 samples per second, and `rate` 60 was taken" in said(wrong)
        assert "samples per second, and" not in said(right)


def test_gravity_is_told_and_is_that_of_the_earth():
    usual, typed = acs.find_holds(table()), acs.find_holds(table(), gravity=9.08795)
    assert "gravity: 9.80665 m/s², as none was given" in usual.notes
    assert "gravity: 9.08795 m/s²" in typed.notes
    assert "no place on Earth" in said(typed)
    assert "no place on Earth" not in said(usual)


def test_a_word_between_the_numbers_of_a_table_in_memory():
    frame = table().astype(object)
    frame.iloc[IN_HOLD, 1] = "x"
    assert "row 131, column ax (fx): 'x'" in said(found(frame))


@pytest.mark.parametrize("index", ["dates", "zone", "durations"])
def test_a_table_in_memory_has_the_time_of_its_index(index):
    times = {"dates": START + pd.to_timedelta(TIME, "s"), "durations": pd.to_timedelta(TIME, "s")}
    times["zone"] = times["dates"].tz_localize("Europe/Berlin")
    frame = table()[["ax", "ay", "az"]].set_index(times[index])
    assert_timed(found(frame))
    by_place = acs.read_log(frame, columns={"fx": 0, "fy": 1, "fz": 2})
    assert len(acs.calibrate(found(by_place)).apply(by_place)) == N
    assert acs.read_log(frame, rate=HAND_RATE).layout.time is None


# --- bags and flight logs ------------------------------------------------------------------------


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("recorded")
    imu, warm = {"/imu/data": FORCES}, {"/imu/temperature": TEMPERATURE}
    write_bag(folder / "one.bag", TIME, imu, warm)
    write_bag(folder / "two", TIME, imu, warm)
    write_bag(folder / "several", TIME, {"/a/imu": FORCES, "/b/imu": -FORCES}, frame="body_ned")
    write_bag(folder / "unstamped.bag", TIME, imu, stamped=False)
    write_bag(folder / "none.bag", TIME, {}, warm)
    write_ulog(folder / "one.ulg", TIME, [FORCES], TEMPERATURE)
    write_ulog(folder / "three.ulg", TIME, [FORCES, -FORCES, FORCES], TEMPERATURE)
    (folder / "cut.bag").write_bytes((folder / "one.bag").read_bytes()[:20000])
    (folder / "alone.mcap").write_bytes((folder / "two/two.mcap").read_bytes())
    fields, sample = "float x;float y;float z;", message("D", struct.pack("<H3f", 0, *range(3)))
    (folder / "untimed.ulg").write_bytes(b"".join([*ulog(fields), sample]))
    (folder / "empty.ulg").write_bytes(b"".join(ulog(fields)))
    table().to_csv(folder / "frd.csv", index=False)
    return folder


@pytest.mark.parametrize(("name", "settings", "turn", "frame"), [
    ("one.bag", {}, FLU, "flu"),
    ("two", {}, FLU, "flu"),
    ("one.bag", {"frame": "frd"}, 1, "frd"),
    ("unstamped.bag", {}, FLU, "flu"),
    ("several", {"variable": "/b/imu"}, -1, "frd"),  # frd, as its frame is called body_ned
    ("one.ulg", {}, 1, "frd"),
    ("three.ulg", {"variable": "1"}, -1, "frd"),
])  # fmt: skip
def test_a_recording_has_forces_temperatures_and_axes(folder, name, settings, turn, frame):
    campaign = found(acs.read_log(folder / name, **settings), turn)
    assert_timed(campaign)
    assert campaign.header.log.frame == frame
    if "one" in name:
        np.testing.assert_allclose(campaign.temperature, 20 + campaign.time / 20, atol=0.05)


def test_a_temperature_before_the_thermometer_is_unknown(tmp_path):
    write_bag(tmp_path / "late", TIME, {"/imu": FORCES}, {"/heat": TEMPERATURE[N // 2 :]})
    campaign = found(tmp_path / "late", FLU)
    assert campaign.temperature is None
    assert "temperature: topic /heat | " in said(campaign)


@pytest.mark.parametrize(("name", "part"), [
    ("none.bag", "no topic of sensor_msgs/Imu"),
    ("several", "which topic of sensor_msgs/Imu? There are /a/imu, /b/imu; give --variable"),
    ("cut.bag", "not a whole bag"),
    ("alone.mcap", "metadata.yaml is missing"),
    ("three.ulg", "which instance of sensor_accel? There are 0, 1, 2; give --variable 0"),
    ("untimed.ulg", "has no field 'timestamp'"),
    ("empty.ulg", "no messages of sensor_accel, the raw readings; let PX4 log them"),
])  # fmt: skip
def test_what_is_no_whole_recording_is_refused_in_a_line(folder, tmp_path, name, part):
    assert part in refusal("import", folder / name, "--out", tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("name", "library", "extra"), [("one.bag", "rosbags", "ros"), ("one.ulg", "pyulog", "px4")]
)
def test_without_the_library_a_line_says_what_to_install(
    folder, tmp_path, monkeypatch, name, library, extra
):
    for module in [m for m in sys.modules if m.partition(".")[0] == library]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, library, None)
    line = refusal("import", folder / name, "--out", tmp_path / "out")
    assert f"pip install 'accelstudy[{extra}]'" in line


@pytest.mark.parametrize(
    ("campaign_of", "name"), [("one.bag", "two"), ("one.bag", "one.ulg"), ("frd.csv", "one.bag")]
)
def test_apply_takes_them_whatever_the_campaign_was_made_of(folder, tmp_path, campaign_of, name):
    """The axes of a calibration turn with those of the file."""
    acs.calibrate(acs.find_holds(folder / campaign_of, gravity=G)).save(tmp_path / "calibrated")
    out = tmp_path / "out.csv"
    succeed("apply", tmp_path / "calibrated/calibration.json", folder / name, "--out", out)
    applied = pd.read_csv(out)
    assert len(applied) == N
    calibrated = applied[[f"f{axis}_calibrated_mps2" for axis in "xyz"]].to_numpy()
    turn = np.array(1 if name == "two" else FLU)
    np.testing.assert_allclose(calibrated, (FORCES - turn * BIAS) / (1 + SCALE), atol=0.05)


def test_a_flight_log_that_ends_early(folder, tmp_path):
    path, whole = tmp_path / "log.ulg", (folder / "one.ulg").read_bytes()
    assert not read_table(folder / "one.ulg").warnings
    path.write_bytes(whole[: len(whole) // 2 + 5])
    text = succeed("import", path, "--no-figure", "--out", tmp_path / "out").stderr
    assert "the flight log ends early or is damaged: its samples are whole up to" in text
    assert acs.read_campaign(tmp_path / "out").n_positions in (6, 7)
    middle = len(whole) // 2
    path.write_bytes(whole[:middle] + b"\xff" * 300 + whole[middle + 300 :])
    assert "is damaged" in read_table(path).warnings[0]


def test_a_bag_that_says_other_axes_than_that_of_the_calibration(folder, tmp_path):
    """Nothing tells which is wrong, so a warning says how it is read, and what changes that."""
    log = acs.read_log(folder / "several", variable="/a/imu")
    calibration = acs.calibrate(acs.find_holds(log, gravity=G))
    write_bag(tmp_path / "turned", TIME, {"/a/imu": FORCES * FLU})
    as_before = acs.apply(calibration, tmp_path / "turned")
    said = " ".join(as_before.attrs["warnings"])
    assert "turned says that its axes are flu, and is read in frd" in said
    turned = acs.apply(calibration, tmp_path / "turned", frame="flu")
    assert "axes" not in " ".join(turned.attrs["warnings"])
    roll = acs.apply(calibration, log)["roll_gon"]
    np.testing.assert_allclose(turned["roll_gon"], roll, rtol=0, atol=1e-6)


def test_a_bag_with_fewer_messages_than_it_says(tmp_path):
    write_bag(tmp_path / "bag", TIME, {"/imu/data": FORCES})
    header = tmp_path / "bag/metadata.yaml"
    header.write_text(header.read_text().replace(f"message_count: {N}", f"message_count: {2 * N}"))
    log = acs.read_log(tmp_path / "bag")
    campaign = acs.find_holds(log, gravity=G)
    few = f"{N} of {2 * N} messages of /imu/data are there, up to {N / HAND_RATE:.1f} s"
    assert few in said(campaign)
    leveled = acs.calibrate(campaign).apply(log)
    assert any(f"{N} of {2 * N} messages" in line for line in leveled.attrs["warnings"])


# --- other rates, and a file for each position ---------------------------------------------------


CLOCKS = {
    "millis": np.round(TIME * 1e3 + 2**32 - 20e3).astype(np.int64) % 2**32,
    "us": np.round(TIME * 1e6 + 2**32 - 20e6).astype(np.int64) % 2**32 - 2**31,  # signed
    "time": [f"{START + timedelta(seconds=41 + t):%H:%M:%S.%f}" for t in TIME],
}
CLOCKS["TimeUS"] = CLOCKS["us"]  # of ArduPilot, whose column T is a temperature


@pytest.mark.parametrize("name", CLOCKS)
def test_a_clock_that_begins_anew_is_counted_on(name):
    log = table(CLOCKS[name], names=(name, "ax", "ay", "az"))
    campaign = found(log.assign(T=TEMPERATURE) if name == "TimeUS" else log)
    assert_timed(campaign)
    assert "the clock wraps around, and is counted on: row 1001" in said(campaign)
    assert "wraps" not in said(found(table()))
    with refused("not after the row above"):  # it may as well have been set back
        found(log[(TIME < 19) | (TIME > 21)])


def test_a_slow_log_has_longer_windows(tmp_path):
    """At 5 Hz a second has too few samples for a variance."""
    slow = np.concatenate([np.repeat(FORCES[i : i + 150 : 3], 2, axis=0) for i in range(0, N, 150)])
    found(table(time=np.arange(len(slow)) / 5, forces=slow))
    # As PX4 logs by default; its times are in no other unit.
    write_ulog(tmp_path / "slow.ulg", np.arange(len(slow)), [slow], np.full(len(slow), 20.0))
    found(tmp_path / "slow.ulg")


def test_rests_that_are_shorter_than_a_hold_are_not_replaced_by_slow_moves():
    """Between turns of 5 s the sensor rests for 1 s, which is no more than a window."""
    rng, rests = np.random.default_rng(3), np.vstack([np.eye(3), -np.eye(3)] * 2)
    parts = []
    for one, next_one in zip(rests, np.roll(rests, -1, axis=0), strict=True):
        way = (1 - np.cos(np.linspace(0, np.pi, 500)))[:, None] / 2
        turn = one + (next_one - one) * way + rng.normal(0, 0.05, (500, 3)).cumsum(axis=0) / 22
        parts += [np.tile(one, (100, 1)), turn]
    forces = G * np.concatenate(parts) + rng.normal(0, 0.003, (len(parts) * 300, 3))
    with refused("the sensor was never still", "like a hand"):
        acs.find_holds(pd.DataFrame(forces, columns=["x", "y", "z"]), rate=100)


@pytest.mark.parametrize("rate", [None, 100], ids=["untimed", "short"])
def test_short_files_of_one_position_each_are_taken_whole(tmp_path, rate):
    means = []
    for number in range(1, HOLDS + 1):
        samples = FORCES[200 * number - 150 : 200 * number - 50]
        if number == 4:  # the sensor is turned in it
            samples = samples + np.linspace(0, 1, 100)[:, None]
        means.append(samples.mean(axis=0))
        frame = pd.DataFrame(samples, columns=["x", "y", "z"])
        frame.to_csv(tmp_path / f"p{number}.csv", index=False)
    campaign = acs.find_holds(tmp_path, rate=rate)
    # The fourth is left out.
    assert campaign.positions.tolist() == [1, 2, 3, *range(5, HOLDS + 1)]
    np.testing.assert_allclose(campaign.forces, np.delete(means, 3, axis=0), atol=1e-9)
    assert campaign.time is None


def test_a_table_of_means_is_told_with_what_it_lacks(tmp_path):
    """Exact names count before letters that mean an axis, too."""
    means = FORCES.reshape(HOLDS, -1, 3)[:, 50:].mean(axis=1)
    columns = dict(zip(("fx", "fy", "fz", "x", "y", "z"), (*means.T, *means.T), strict=True))
    frame = pd.DataFrame({"t": 6e4 * np.arange(HOLDS), **columns, "roll": 0.0, "pitch": 0.0})
    frame[["roll", "pitch"]] = angles_of(means) / GON
    campaign = acs.find_holds(frame, means=True, time="t", robot_sigma="3 mgon", frame="frd")
    assert "forces in m/s^2, angles in gon, axes frd; not used: x, y, z" in said(campaign)
    assert "without the robot's yaw" in said(campaign)
    assert "h apart on average; is `time_unit` s right?" in said(campaign)
    frame = frame.assign(t=20 * np.arange(HOLDS), yaw=0.0)
    campaign = acs.find_holds(frame, means=True, time="t", robot_sigma="3 mgon")
    assert campaign.warnings == ()
