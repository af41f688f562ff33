"""The campaign format: what is written is read again, and what is wrong ends in one clear line."""

import shutil
from dataclasses import fields, replace
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import yaml
from calling import refused
from hypothesis import given
from hypothesis import strategies as st

from accelstudy.basics.errors import InputError, printable_line
from accelstudy.basics.units import GON, MGON, STANDARD_GRAVITY
from accelstudy.campaign.format import read_campaign, write_campaign
from accelstudy.campaign.header import LogLayout
from accelstudy.campaign.session import Campaign
from accelstudy.leveling.angles import specific_force
from accelstudy.sensors.conversion import Conversion

ROLL = np.array([0.0, 50.0, 100.0, 150.0, 200.0, -50.0, -100.0, 0.0])
PITCH = np.array([0.0, 20.0, -40.0, 10.0, 0.0, 80.0, -60.0, -80.0])
G = 9.81


def campaign(**changes):
    """A small campaign with everything, whose forces fit the robot's angles to 0.02 m/s²."""
    n = len(ROLL)
    noise = np.random.default_rng(1).normal(0, 0.02, (n, 3))
    everything = Campaign(
        name="small", sensor="a sensor", positions=np.arange(1, n + 1),
        forces=np.column_stack(specific_force(ROLL * GON, PITCH * GON, G)) + noise, gravity=G,
        sigma_gravity=1e-5, sigma_force=0.002, angles=np.column_stack([ROLL, PITCH]) * GON,
        sigma_angle=3.2 * MGON, n_samples=np.full(n, 200), sd=np.full((n, 3), 0.03),
        full_range=20.0,
        log=LogLayout(columns={"fx": 0, "fy": "b", "fz": 2}, rate_hz=100, frame="flu"),
        time=10.0 * np.arange(n), temperature=np.linspace(-5, 30, n), vibration=np.full(n, 0.001),
        yaw=np.linspace(-1, 1, n),
    )  # fmt: skip
    return replace(everything, **changes)


WITHOUT_ROBOT = {"angles": None, "sigma_angle": None, "yaw": None}


def assert_same(read, written):
    for field in fields(Campaign):
        one, other = getattr(read, field.name), getattr(written, field.name)
        if isinstance(other, np.ndarray):
            # Counts have an offset, so what is exact is relative to the norm, not to each number.
            size = np.abs(other).max(initial=0)
            np.testing.assert_allclose(
                one, other, rtol=1e-12, atol=1e-12 * size, err_msg=field.name
            )
        elif isinstance(other, float):
            assert one == pytest.approx(other, rel=1e-12), field.name
        elif isinstance(other, Conversion):
            np.testing.assert_array_equal([one.scale, one.offset], [other.scale, other.offset])
        else:
            assert one == other, field.name


def test_holds_that_are_left_out_stay_in_the_file_and_in_the_history(tmp_path):
    every = campaign(temperature=np.arange(8.0) ** 2)
    reasons = {3: "moved", 8: "bumped"}
    write_campaign(every.without({8: "bumped"}).without({3: "moved"}), tmp_path)
    assert len((tmp_path / "positions.csv").read_text().splitlines()) == 1 + every.n_positions
    read = read_campaign(tmp_path)
    assert read.positions.tolist() == [1, 2, 4, 5, 6, 7]
    assert read.reasons == reasons
    assert read.exclusions[0] == {"position": 3, "reason": "moved"}
    assert_same(read.whole, every)
    kept = read.positions - 1
    for name in ("step_x", "temperature", "yaw", "roll", "order"):
        np.testing.assert_allclose(
            getattr(read.hold, name), getattr(every.hold, name)[kept], atol=1e-12
        )
    np.testing.assert_allclose(read.hold.lagged(20), every.hold.lagged(20)[kept], atol=1e-12)
    untimed = replace(every, time=None).without(reasons)
    assert untimed.hold.order.tolist() == [1, 2, 4, 5, 6, 7]


@pytest.mark.parametrize(("reasons", "message"), [
    ({9: "moved"}, "excluded: there is no position 9"),
    (dict.fromkeys(range(1, 9), "moved"), "excluded: no position is left"),
])  # fmt: skip
def test_what_cannot_be_left_out(reasons, message):
    with pytest.raises(InputError, match=message):
        campaign().without(reasons)


def floats(low, high):
    return st.floats(low, high, allow_subnormal=False)


texts = st.text(st.characters(exclude_categories=["Cs"])).map(printable_line)


@st.composite
def campaigns(draw):
    n = draw(st.integers(1, 12))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    gravity = draw(floats(9.7, 9.9))
    roll, pitch = rng.uniform(-np.pi, np.pi, n), rng.uniform(-np.pi / 2, np.pi / 2, n)
    forces = np.column_stack(specific_force(roll, pitch, gravity)) + rng.normal(0, 0.05, (n, 3))

    def maybe(values):
        return values if draw(st.booleans()) else None

    robot = draw(st.booleans())
    unit = draw(st.sampled_from(["m/s^2", "g", "counts"]))
    scale, offset = rng.uniform(1e-4, 1e-2, 3) * rng.choice([-1, 1], 3), rng.normal(0, 3e4, 3)
    return Campaign(
        name=draw(texts.filter(bool)),
        sensor=maybe(draw(texts)),
        positions=np.cumsum(rng.integers(1, 3, n)), forces=forces, gravity=gravity,
        sigma_gravity=draw(st.just(0.0) | floats(1e-9, 1e-3)), unit=unit,
        sigma_force=maybe(draw(floats(1e-6, 1))),
        angles=np.column_stack([roll, pitch]) if robot else None,
        sigma_angle=draw(st.just(0.0) | floats(1e-9, 1e-3)) if robot else None,
        yaw=rng.normal(size=n) if robot else None, n_samples=maybe(rng.integers(1, 10**6, n)),
        sd=maybe(rng.uniform(0, 1, (n, 3))), full_range=maybe(draw(floats(20, 200))),
        time=maybe(np.cumsum(rng.uniform(0, 60, n))), temperature=maybe(rng.uniform(-40, 85, n)),
        vibration=maybe(rng.uniform(0, 1, n)),
        nominal=Conversion(scale, offset) if unit == "counts" else None,
    )  # fmt: skip


@given(campaigns(), st.sampled_from(["csv", "parquet"]))
def test_what_is_written_is_read_again(written, table):
    with TemporaryDirectory() as folder:
        write_campaign(written, folder, table)
        assert_same(read_campaign(folder), written)


def test_one_table_replaces_the_other(tmp_path):
    for table in ("csv", "parquet", "csv"):
        write_campaign(campaign(name=table), tmp_path, table)
        assert read_campaign(tmp_path).name == table


def test_units_of_the_file(tmp_path):
    """g is standard gravity, whatever local gravity is; an sd in counts is positive."""
    text = "position,fx,fy,fz,sd_fx,sd_fy,sd_fz\n1,0.5,-1,0,1,1,1\n2,0,0,-1,2,2,2\n"
    (tmp_path / "positions.csv").write_text(text.replace("-1,0,", "-1,0.1,"))
    header = {"schema_version": 1, "name": "a", "unit": "g", "gravity": {"value_mps2": 9.82}}
    (tmp_path / "campaign.yaml").write_text(yaml.safe_dump(header))
    read = read_campaign(tmp_path)
    np.testing.assert_allclose(read.forces[1], [0, 0, -STANDARD_GRAVITY])
    np.testing.assert_allclose(read.sd[1], 2 * STANDARD_GRAVITY)
    header |= {"unit": "counts", "nominal": {"scale": [9.8, -9.8, 9.8], "offset": [0.1, 0, 0]}}
    (tmp_path / "campaign.yaml").write_text(yaml.safe_dump(header))
    read = read_campaign(tmp_path)
    np.testing.assert_allclose(read.forces[0], [0.4 * 9.8, 9.8, 0.98])
    np.testing.assert_allclose(read.sd[0], 9.8)


def test_yaw_of_a_robot_that_gives_none_is_zero(tmp_path):
    write_campaign(campaign(yaw=None), tmp_path)
    np.testing.assert_array_equal(read_campaign(tmp_path).yaw, np.zeros(len(ROLL)))
    write_campaign(campaign(**WITHOUT_ROBOT), tmp_path)
    assert read_campaign(tmp_path).yaw is None


@pytest.mark.parametrize("table", ["csv", "parquet"])
def test_unknown_columns_are_named_and_left_out(tmp_path, table):
    write_campaign(campaign(), tmp_path, table)
    path = tmp_path / f"positions.{table}"
    if table == "csv":
        lines = path.read_text().splitlines()
        rows = [lines[0] + ",temperature_degc,note", *(f"{line},20,x" for line in lines[1:])]
        path.write_text("\n".join(rows) + "\n")
    else:
        content = pq.read_table(path)
        for name in ("temperature_degc", "note"):
            content = content.append_column(name, pa.array(["x"] * len(content)))
        pq.write_table(content, path)
    read = read_campaign(tmp_path)
    assert_same(replace(read, warnings=()), campaign())
    first, second = read.warnings
    assert "'temperature_degc'" in first
    assert "did you mean 'temperature_degC'" in first
    assert "'note'" in second


def test_a_last_line_that_does_not_end_is_mentioned(tmp_path):
    """A cut in the last number cannot be seen otherwise."""
    write_campaign(campaign(), tmp_path)
    path = tmp_path / "positions.csv"
    path.write_text(path.read_text()[:-3])
    (warning,) = read_campaign(tmp_path).warnings
    assert "last line" in warning


def test_tolerated_ways_of_writing_csv(tmp_path):
    """A byte order mark, line ends of Windows, blanks, empty lines."""
    write_campaign(campaign(), tmp_path)
    path = tmp_path / "positions.csv"
    text = path.read_text().replace(",", " , ").replace("\n", "\r\n\r\n")
    path.write_bytes(b"\xef\xbb\xbf" + text.encode())
    assert_same(read_campaign(tmp_path), campaign())


# Bad input: what is done to the files, and what the message must say.


def header(**changes):
    """Change keys of campaign.yaml; None removes one."""

    def change(folder):
        path = folder / "campaign.yaml"
        content = yaml.safe_load(path.read_text()) | changes
        path.write_text(yaml.safe_dump({k: v for k, v in content.items() if v is not None}))

    return change


def columns(**changes):
    """Change columns of the table, by a function of the old one; None removes one."""

    def change(folder):
        path = folder / "positions.csv"
        table = pd.read_csv(path, dtype=str)
        for name, new in changes.items():
            old = [*table.pop(name)] if name in table else [""] * len(ROLL)
            if new is not None:
                table[name] = [*map(str, new(old))]
        table.to_csv(path, index=False)

    return change


def forces(factor):
    return columns(**dict.fromkeys(("fx", "fy", "fz"), times(factor)))


def at(position, value):
    """Column with one other value."""
    return lambda old: [*old[: position - 1], value, *old[position:]]


def times(factor):
    return lambda old: [float(value) * factor for value in old]


def text(name, content):
    encoded = content if isinstance(content, bytes) else content.encode()
    return lambda folder: (folder / name).write_bytes(encoded)


def cut(name, share):
    def change(folder):
        content = (folder / name).read_bytes()
        (folder / name).write_bytes(content[: int(share * len(content))])

    return change


def remove(name):
    return lambda folder: (folder / name).unlink()


def parquet(fx, name="fx"):
    """The table as Parquet, with another column."""

    def change(folder):
        (folder / "positions.csv").unlink()
        write_campaign(campaign(), folder, "parquet")
        path = folder / "positions.parquet"
        table = pq.read_table(path)
        if name == "fx":
            table = table.set_column(table.column_names.index("fx"), "fx", pa.array(fx))
        else:
            table = table.append_column("fx", table["fx"])
        pq.write_table(table, path)

    return change


def both(*changes):
    def change(folder):
        for one in changes:
            one(folder)

    return change


ROBOT_COLUMNS = ("roll_robot_gon", "pitch_robot_gon", "yaw_robot_gon")

BAD = {
    "no header": (remove("campaign.yaml"), "campaign.yaml", "no such file"),
    "no table": (remove("positions.csv"), "no table", "positions.csv or positions.parquet"),
    "two tables": (both(text("positions.parquet", "")), "two tables", "either positions.csv or"),
    "unknown key": (header(sensr="x"), "sensr: unknown key", "did you mean 'sensor'"),
    "version": (header(schema_version=2), "schema_version", "2 is of a newer version"),
    "unit": (header(unit="ug"), "unit", "'m/s^2', 'g', 'mg' or 'counts'", "not 'ug'"),
    "negative gravity": (header(gravity={"value_mps2": -9.81}), "from 0.001 to 1000"),
    "gravity in g": (header(gravity={"value_mps2": 1}), "gravity of 1 m/s²",
                     "campaign.yaml and", "`gravity`"),
    "counts without nominal": (header(unit="counts"), "nominal: missing"),
    "nominal without counts": (header(nominal={"scale": [1, 1, 1], "offset": [0, 0, 0]}),
                               "nominal: goes with unit: counts, not with unit: m/s^2"),
    "scale zero": (header(unit="counts", nominal={"scale": [1, 0, 1], "offset": [0, 0, 0]}),
                   "nominal.scale.1", "zero"),
    "empty CSV": (text("positions.csv", ""), "empty", "position, fx, fy, fz"),
    "names only": (text("positions.csv", "position,fx,fy,fz\n"), "no positions"),
    "truncated CSV": (cut("positions.csv", 0.7), "line", "columns", "whole"),
    "no text": (text("positions.csv", b"\xff\xfe\x00a"), "UTF-8"),
    "open quote": (text("positions.csv", 'position,"fx'), "not a whole CSV"),
    "semicolons": (text("positions.csv", "position;fx;fy;fz\n"), "';'", "comma"),
    "twice": (text("positions.csv", "position,fx,fx\n1,2,3\n"), "'fx'", "twice"),
    "no fy": (columns(fy=None), "fy: the column is missing", "fx, fz"),
    "other case": (columns(fx=None, Fx=lambda old: [1] * 8), "fx:", "is 'Fx' meant"),
    "no positions": (columns(position=None), "position: the column is missing"),
    "word": (columns(fx=at(3, "abc")), "fx: position 3: 'abc' is no number"),
    "decimal comma": (columns(fx=at(3, '"9"";8"')), "position 3", "is no number"),
    "gap": (columns(fz=at(2, "")), "fz: position 2: empty"),
    "nan": (columns(fx=at(4, "nan")), "fx: position 4: nan is not finite"),
    "overflow": (columns(fx=at(4, "1e999")), "fx: position 4", "not finite"),
    "stuck channel": (columns(fy=lambda old: [1.5] * 8), "fy: 1.5 in all positions"),
    "same position": (columns(position=at(3, 2)), "position: position 2: 2 follows"),
    "unordered": (columns(position=lambda old: old[::-1]), "position 7", "acquisition"),
    "position zero": (columns(position=at(1, 0)), "position 0: must be from 1 to", "not 0"),
    "no position": (columns(position=at(6, "")), "position: row 6: empty"),
    "half a position": (columns(position=at(3, 2.5)), "2.5 is no whole number"),
    "no samples": (columns(n_samples=at(2, 0)), "n_samples: position 2: must be from 1 to"),
    "negative sd": (columns(sd_fy=at(5, -0.1)), "sd_fy: position 5: must be from 0 to"),
    "one sd": (columns(sd_fx=None), "sd_fx: the column is missing", "sd_fy, sd_fz"),
    "too cold": (columns(temperature_degC=at(1, -300)), "temperature_degC: position 1: ",
                 "not -300"),
    "negative vibration": (columns(vibration_mps2=at(1, -1)), "vibration_mps2: position 1: ",
                           "not -1"),
    "time runs back": (columns(time_s=at(4, 15)), "time_s: position 4: 15 is before"),
    "roll only": (columns(pitch_robot_gon=None),
                  "pitch_robot_gon: the column is missing (it goes with roll_robot_gon)"),
    "yaw only": (both(header(robot=None), columns(pitch_robot_gon=None, roll_robot_gon=None)),
                 "positions.csv: yaw_robot_gon: goes with roll_robot_gon and pitch_robot_gon"),
    "endless angles": (columns(roll_robot_gon=times(1e300)), "roll_robot_gon: position ",
                       "must be from -400 to 400 gon"),
    "robot without sigma": (header(robot=None), "robot.angle_sigma_mgon: missing"),
    "sigma without robot": (
        columns(**dict.fromkeys(ROBOT_COLUMNS)),
        "robot.angle_sigma_mgon: is given, but positions.csv has no roll_robot_gon",
    ),
    "degrees": (columns(roll_robot_gon=times(0.9), pitch_robot_gon=times(0.9)),
                "the robot's angles are in degrees, not in gon"),
    "radians": (columns(roll_robot_gon=times(GON), pitch_robot_gon=times(GON)),
                "the robot's angles are in radians, not in gon"),
    "opposite sign": (forces(-1), "axes have the wrong sign",
                      "(0, 0, −g)"),
    "g for m/s^2": (forces(1 / G), "about 1 m/s²",
                    "look like g, not m/s^2"),
    "m/s^2 for g": (header(unit="g"), "look like m/s^2, not g", "campaign.yaml and"),
    "counts for m/s^2": (forces(1e3),
                         "look like counts, not m/s^2"),
    "m/s^2 for counts": (
        header(unit="counts", nominal={"scale": [0.01] * 3, "offset": [0, 0, 0]}),
        "look like m/s^2, not counts",
    ),
    "wrong nominal": (
        both(
            header(unit="counts", nominal={"scale": [0.01] * 3, "offset": [0, 0, 0]}),
            forces(400),
        ),
        "positions.csv: ", "nowhere near gravity", "`scale`",
    ),
    "no unit fits": (forces(0.3),
                     "nowhere near gravity, 9.81 m/s²"),
    "no force": (columns(**{f: lambda old: [1e-300 * k for k in range(8)]
                            for f in ("fx", "fy", "fz")}), "their norm is about 0 m/s²"),
    "one huge cell": (columns(fy=at(3, 1e11)), "fx, fy, fz: position 3: more than 1000 times"),
    "huge": (forces(1e300),
             "fx: position 1: must be from -1e+12 to"),
    "words in Parquet": (parquet(["a"] * 8), "positions.parquet: fx: position 1: 'a' is no number"),
    "null": (parquet([None, *range(7)]), "fx: position 1: empty"),
    "truth values": (parquet([True] * 8), "fx: position 1: True is no number"),
    "lists": (parquet([[1.0]] * 8), "fx: position 1: [1.0] is no number"),
    "nan in Parquet": (parquet([1.0, *[np.nan] * 7]), "fx: position 2: nan is not finite"),
    "twice in Parquet": (parquet(None, "twice"), "'fx': the column stands twice"),
    "cut Parquet": (both(parquet([1.0] * 8), cut("positions.parquet", 0.5)),
                    "positions.parquet: not a whole Parquet file"),
    "no folder": (shutil.rmtree, "no such folder", "campaign.yaml and positions.csv"),
}  # fmt: skip


@pytest.mark.parametrize(("change", "parts"), [(c, p) for c, *p in BAD.values()], ids=BAD)
def test_bad_input_ends_with_one_line_that_says_where(tmp_path, change, parts):
    write_campaign(campaign(), tmp_path / "c")
    change(tmp_path / "c")
    with refused(str(tmp_path), *parts):
        read_campaign(tmp_path / "c")


@pytest.mark.parametrize("change", [{"angles": 1e-4}, {"angles": 0.0}], ids=["small", "level"])
def test_angles_that_tell_nothing_are_no_error(tmp_path, change):
    """Near level degrees, radians and gon are alike, and a poor sensor is not the robot's fault."""
    angles = np.full((len(ROLL), 2), change["angles"])
    forces = np.array([0, 0, -G]) + np.random.default_rng(1).normal(0, 0.3, (len(ROLL), 3))
    write_campaign(campaign(angles=angles, forces=forces), tmp_path)
    assert_same(read_campaign(tmp_path), campaign(angles=angles, forces=forces))


def test_a_poor_sensor_is_no_error(tmp_path):
    """Biases of 1 m/s² and scales 20 % off are what calibration is for."""
    poor = campaign(forces=1.2 * campaign().forces + [1.0, -0.5, 0.7])
    write_campaign(poor, tmp_path)
    assert_same(read_campaign(tmp_path), poor)


@pytest.mark.parametrize(("changes", "part"), [
    ({"name": ""}, "name"),
    ({"name": "\ud800"}, "name"),
    ({"unit": "ug"}, "unit"),
    ({"unit": "counts"}, "nominal"),
    ({"forces": np.full((8, 3), np.nan)}, "not finite"),
    ({"time": np.arange(7)}, r"time: shape \(7,\), not \(8,\)"),
    ({"positions": np.arange(8)}, "position 0"),
    ({"angles": None}, "yaw"),
    ({"sigma_angle": None}, "robot"),
])  # fmt: skip
def test_what_could_not_be_read_again_is_not_written(tmp_path, changes, part):
    with pytest.raises(InputError, match=part):
        write_campaign(campaign(**changes), tmp_path / "folder")
    assert not (tmp_path / "folder").exists()
