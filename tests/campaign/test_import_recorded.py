"""Logs as robots and loggers record them: bags, flight logs, dates, names of ROS, slow rates."""

import struct
import sys
from datetime import UTC, datetime, timedelta, timezone

import numpy as np
import pandas as pd
import pytest
from calling import refusal, succeed
from log_helpers import open_log
from recorded import EPOCH, write_bag, write_ulog

import accelstudy as acs
from accelstudy.campaign.format import read_campaign
from accelstudy.campaign.importing.logs import import_log
from accelstudy.campaign.importing.settings import parse_settings

G, SIGMA, COUNT = 9.80665, 0.01, 12
FLU_TO_FRD = np.array([1.0, -1.0, -1.0])


def attitudes(seed, count=COUNT):
    directions = np.random.default_rng(seed).standard_normal((count, 3))
    return G * directions / np.linalg.norm(directions, axis=1, keepdims=True)


def session(rate, hold, move, seed=4):
    """Times, readings and attitudes of a log with a shake between its holds."""
    rng = np.random.default_rng(seed)
    truth, parts = attitudes(seed), []
    for force in truth:
        parts.append(force + rng.normal(0, 2.0, (int(move * rate), 3)))
        parts.append(force + rng.normal(0, SIGMA, (int(hold * rate), 3)))
    forces = np.concatenate(parts)
    return np.arange(len(forces)) / rate, forces, truth


TIME, FORCES, TRUTH = session(rate=20, hold=6.0, move=2.0)
TEMPERATURE = 20 + TIME / 10


def assert_found(campaign, truth=TRUTH, step=1 / 20, timed=True):
    """A mean of some 80 samples of 0.01 m/s² is right to 5 sd or so."""
    np.testing.assert_allclose(campaign.forces, truth, atol=5 * SIGMA / np.sqrt(20))
    if timed:
        # The middle of a hold, which begins and ends with a window at rest.
        expected = 8.0 * np.arange(len(truth)) + 5.0
        np.testing.assert_allclose(campaign.time, expected, atol=0.3)


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
    return folder


@pytest.mark.parametrize("name", ["one.bag", "two", "two/two.mcap"])
def test_a_bag_has_forces_in_flu_and_temperatures(folder, name):
    campaign, _ = import_log(folder / name)
    assert_found(campaign, TRUTH * FLU_TO_FRD)
    np.testing.assert_allclose(campaign.temperature, 20 + campaign.time / 10, atol=0.05)
    assert campaign.log.frame == "flu"
    assert any("axes: flu" in note for note in campaign.notes)


def test_a_frame_that_is_given_is_that_of_the_bag(folder):
    campaign, _ = import_log(folder / "one.bag", parse_settings({"frame": "frd"}))
    assert_found(campaign)


def test_a_bag_without_stamps_has_the_times_of_recording(folder):
    assert_found(import_log(folder / "unstamped.bag")[0], TRUTH * FLU_TO_FRD)


def test_one_of_several_topics_is_chosen(folder, tmp_path):
    line = refusal("import", folder / "several", "--out", tmp_path / "out")
    assert "which topic of sensor_msgs/Imu? There are /a/imu, /b/imu; give --variable" in line
    succeed("import", folder / "several", "--variable", "/b/imu", "--out", tmp_path / "out")
    assert_found(read_campaign(tmp_path / "out"), -TRUTH)  # frd, as its frame is called body_ned
    line = refusal("import", folder / "several", "--variable", "/c", "--out", tmp_path / "c")
    assert "unknown topic of sensor_msgs/Imu" in line


def test_a_flight_log_has_forces_in_frd_and_temperatures(folder):
    campaign, _ = import_log(folder / "one.ulg")
    assert_found(campaign)
    np.testing.assert_allclose(campaign.temperature, 20 + campaign.time / 10, atol=0.05)


def test_one_of_several_instances_is_chosen(folder, tmp_path):
    line = refusal("import", folder / "three.ulg", "--out", tmp_path / "out")
    assert "which instance of sensor_accel? There are 0, 1, 2; give --variable 0" in line
    assert_found(import_log(folder / "three.ulg", parse_settings({"variable": "1"}))[0], -TRUTH)


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("none.bag", "no topic of sensor_msgs/Imu"),
        ("cut.bag", "not a whole bag"),
        ("cut.ulg", "no instance of sensor_accel"),
        ("alone.mcap", "metadata.yaml is missing"),
    ],
)
def test_what_is_no_whole_recording_is_refused_in_a_line(folder, tmp_path, name, says):
    (folder / "cut.bag").write_bytes((folder / "one.bag").read_bytes()[:20000])
    (folder / "cut.ulg").write_bytes((folder / "one.ulg").read_bytes()[:120])
    (folder.parent / "alone.mcap").write_bytes((folder / "two/two.mcap").read_bytes())
    path = folder.parent / name if name == "alone.mcap" else folder / name
    assert says in refusal("import", path, "--out", tmp_path / "out")


def ulog(*formats):
    """A flight log of these formats, with one sample of a sensor_accel of five floats."""

    def message(kind, content):
        return struct.pack("<HB", len(content), ord(kind)) + content

    parts = [b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0), message("B", bytes(40))]
    parts += [message("F", each.encode()) for each in formats]
    parts.append(message("A", struct.pack("<BH", 0, 0) + b"sensor_accel"))
    return b"".join((*parts, message("D", struct.pack("<H5f", 0, *range(5)))))


@pytest.mark.parametrize(
    ("formats", "says"),
    [
        (["sensor_accel:float x;float y;float z;float a;float b;"], "has no field 'timestamp'"),
        (["sensor_accel:uint64_t timestamp;float y;float z;float a;"], "has no field 'x'"),
    ],
)
def test_a_flight_log_of_odd_messages_is_refused_in_a_line(tmp_path, formats, says):
    (tmp_path / "odd.ulg").write_bytes(ulog(*formats))
    assert says in refusal("import", tmp_path / "odd.ulg", "--out", tmp_path / "out")


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
    ("campaign_of", "name"),
    [("one.bag", "two"), ("one.bag", "one.ulg"), ("one.ulg", "one.bag"), ("frd.csv", "one.bag")],
)
def test_apply_takes_them_whatever_the_campaign_was_made_of(folder, tmp_path, campaign_of, name):
    """The same sensor on the same body: its axes turn with the frame of the file."""
    table = pd.DataFrame(FORCES, columns=["ax", "ay", "az"]).assign(t=TIME)
    table.to_csv(folder / "frd.csv", index=False)
    flu = campaign_of == "one.bag"
    campaign = acs.find_holds(folder / campaign_of, gravity=G)
    acs.calibrate(campaign).save(tmp_path / "calibrated")
    out = tmp_path / "out.csv"
    succeed("apply", tmp_path / "calibrated/calibration.json", folder / name, "--out", out)
    applied = pd.read_csv(out)
    assert len(applied) == len(FORCES)
    # The sensor has no errors: what is written is what was read, in the axes of the file.
    calibrated = applied[[f"f{axis}_calibrated_mps2" for axis in "xyz"]].to_numpy()
    rest = np.linalg.norm(FORCES, axis=1) < G + 0.05
    np.testing.assert_allclose(calibrated[rest], FORCES[rest], atol=0.05)
    assert flu == (campaign.log.frame == "flu")


def test_python_reads_a_bag(folder):
    log = acs.read_log(folder / "several", variable="/a/imu")
    assert_found(acs.find_holds(log, gravity=G))


def stamps(zone=UTC, text="%Y-%m-%dT%H:%M:%S.%f%z"):
    start = datetime.fromtimestamp(EPOCH, UTC).astimezone(zone)
    return [(start + timedelta(seconds=float(t))).strftime(text) for t in TIME]


def table_of(**before):
    names = ["ax", "ay", "az"]
    return pd.DataFrame(before).assign(**dict(zip(names, FORCES.T, strict=True)))


@pytest.mark.parametrize(
    "dates",
    [
        stamps(),
        stamps(timezone(timedelta(hours=5, minutes=30))),
        stamps(text="%Y-%m-%d %H:%M:%S.%f"),
        [text.replace("+0000", "Z") for text in stamps()],
        # A clock that is put back in the middle of the log: the zone tells it.
        [*stamps(timezone(timedelta(hours=2)))[:700], *stamps(timezone(timedelta(hours=1)))[700:]],
    ],
    ids=["utc", "zone", "none", "Z", "winter"],
)
@pytest.mark.parametrize("kind", ["csv", "parquet", "dates"])
def test_dates_with_times_are_a_column_of_time(tmp_path, dates, kind):
    table, path = table_of(time=dates), tmp_path / f"log.{'csv' if kind == 'csv' else 'parquet'}"
    if kind == "dates":
        table["time"] = pd.to_datetime(table["time"], utc=True, format="ISO8601")
    if kind == "csv":
        table.to_csv(path, index=False)
    else:
        table.to_parquet(path, index=False)
    log = open_log(path)
    times = log.time
    np.testing.assert_allclose(times, TIME, atol=1e-9)
    assert log.starts[0] == pytest.approx(EPOCH, abs=1e-3)


def test_a_bad_date_and_a_unit_of_dates_are_refused_in_a_line(tmp_path):
    dates = stamps()
    path = tmp_path / "log.csv"
    table_of(time=dates).to_csv(path, index=False)
    line = refusal("import", path, "--time-unit", "ms", "--out", tmp_path / "out")
    assert "column time tells its unit; leave --time-unit out" in line
    table_of(time=["yesterday", "today"] * (len(dates) // 2)).to_csv(path, index=False)
    line = refusal("import", path, "--out", tmp_path / "out")
    assert "line 2, column time (time): 'yesterday', not a usable number; give the rate" in line


def test_apply_levels_a_log_with_dates(tmp_path):
    path = tmp_path / "log.csv"
    table_of(time=stamps()).to_csv(path, index=False)
    calibration = acs.calibrate(acs.find_holds(path, gravity=G))
    calibration.save(tmp_path / "calibrated")
    out = tmp_path / "out.csv"
    succeed("apply", tmp_path / "calibrated/calibration.json", path, "--out", out)
    assert pd.read_csv(out)["time"].tolist() == stamps()


@pytest.mark.parametrize(
    ("prefix", "point", "seconds", "rest"),
    [
        ("", ".", "header.stamp.secs", "header.stamp.nsecs"),
        ("field.", ".", "field.header.stamp.secs", "field.header.stamp.nsecs"),
        (".", ".", ".header.stamp.sec", ".header.stamp.nanosec"),
        ("/imu/data/", "/", "/imu/data/header/stamp/sec", "/imu/data/header/stamp/nanosec"),
        ("", "_", "secs", "nsecs"),
    ],
)
def test_columns_of_ros_are_recognised(tmp_path, prefix, point, seconds, rest):
    whole = np.floor(TIME + 1e-9)
    columns = {
        f"{prefix}header{point}seq": np.arange(len(TIME)),
        seconds: (EPOCH + whole).astype(int),
        rest: np.round((TIME - whole) * 1e9).astype(int),
        f"{prefix}angular_velocity{point}x": 0.0,
    }
    axes = [f"{prefix}linear_acceleration{point}{axis}" for axis in "xyz"]
    table = pd.DataFrame(columns).assign(**dict(zip(axes, FORCES.T, strict=True)))
    table.to_csv(tmp_path / "log.csv", index=False)
    campaign, _ = import_log(tmp_path / "log.csv")
    assert_found(campaign, TRUTH * FLU_TO_FRD)


def test_two_axes_are_refused_with_the_reason(tmp_path):
    table = pd.DataFrame({"time": TIME, "incl x": FORCES[:, 0], "incl y": FORCES[:, 1]})
    table.assign(temperature=TEMPERATURE).to_csv(tmp_path / "log.csv", index=False)
    line = refusal("import", tmp_path / "log.csv", "--out", tmp_path / "out")
    assert "two axes, as of an inclinometer, cannot be calibrated" in line
    assert "compared with gravity" in line


def test_a_slow_log_has_longer_windows(tmp_path):
    """At 5 Hz a second has too few samples for a variance."""
    time, forces, truth = session(rate=5, hold=9.0, move=3.0)
    table = pd.DataFrame(forces, columns=["ax", "ay", "az"]).assign(time=time)
    table.to_csv(tmp_path / "log.csv", index=False)
    campaign, _ = import_log(tmp_path / "log.csv")
    assert_found(campaign, truth, timed=False)


@pytest.mark.parametrize("words", [(), ("--rate", "100")], ids=["untimed", "short"])
def test_short_files_of_one_position_each_are_taken_whole(tmp_path, words):
    rng = np.random.default_rng(5)
    truth, folder = attitudes(6), tmp_path / "positions"
    folder.mkdir()
    means = []
    for number, force in enumerate(truth, 1):
        samples = force + rng.normal(0, SIGMA, (100, 3))
        if number == 4:  # the sensor is turned in it
            samples += np.linspace(0, 1, 100)[:, None]
        means.append(samples.mean(axis=0))
        table = pd.DataFrame(samples, columns=["x", "y", "z"])
        table.to_csv(folder / f"p{number}.csv", index=False)
    succeed("import", folder, *words, "--out", tmp_path / "out")
    campaign = read_campaign(tmp_path / "out")
    # The fourth is left out.
    assert campaign.positions.tolist() == [1, 2, 3, *range(5, COUNT + 1)]
    np.testing.assert_allclose(campaign.forces, np.delete(means, 3, axis=0), atol=1e-9)
    assert campaign.time is None
