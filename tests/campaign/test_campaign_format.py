"""The campaign format: what is written is read again, and what is wrong ends in one clear line."""

from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd
import pytest
import yaml
from calling import refused
from hypothesis import given
from hypothesis import strategies as st

from accelstudy.basics.errors import printable_line
from accelstudy.basics.units import GON, STANDARD_GRAVITY
from accelstudy.campaign.columns import COLUMNS, KEYS
from accelstudy.campaign.format import read_campaign, write_campaign
from accelstudy.campaign.header import LogLayout
from accelstudy.campaign.session import Campaign
from accelstudy.leveling.angles import specific_force

ROLL = np.array([0.0, 50.0, 100.0, 150.0, 200.0, -50.0, -100.0, 0.0])
PITCH = np.array([0.0, 20.0, -40.0, 10.0, 0.0, 80.0, -60.0, -80.0])
G = 9.81


HEADER = {
    "name": "small", "sensor": "a sensor", "range_mps2": 20.0,
    "gravity": {"value_mps2": G, "sigma_mps2": 1e-5},
    "sensor_noise": {"sigma_mps2": 0.002}, "robot": {"angle_sigma_mgon": 3.2},
    "log": LogLayout(columns={"fx": 0, "fy": "b", "fz": 2}, rate=100, frame="flu"),
}  # fmt: skip


def campaign(header=(), **changes):
    """A small campaign with everything, whose forces fit the robot's angles to 0.02 m/s²."""
    n = len(ROLL)
    noise = np.random.default_rng(1).normal(0, 0.02, (n, 3))
    arrays = {
        "forces": np.column_stack(specific_force(ROLL * GON, PITCH * GON, G)) + noise,
        "angles": np.column_stack([ROLL, PITCH]) * GON, "yaw": np.linspace(-1, 1, n),
        "n_samples": np.full(n, 200), "sd": np.full((n, 3), 0.03), "time": 10.0 * np.arange(n),
        "temperature": np.linspace(-5, 30, n), "vibration": np.full(n, 0.001),
    }  # fmt: skip
    return Campaign.of({**HEADER, **dict(header)}, **{**arrays, **changes})


def assert_same(read, written):
    assert read.header == written.header
    assert read.warnings == written.warnings
    # Counts have an offset, so what is exact is relative to the largest number.
    sizes = written.holds.drop(columns="left_out").abs().max().clip(lower=1e-300)
    pd.testing.assert_frame_equal(
        read.holds.drop(columns="left_out") / sizes,
        written.holds.drop(columns="left_out") / sizes,
        rtol=1e-12, atol=1e-12, check_like=True,
    )  # fmt: skip
    assert read.reasons == written.reasons


def test_holds_that_are_left_out_stay_in_the_file_and_in_the_history(tmp_path):
    every = campaign(temperature=np.arange(8.0) ** 2)
    reasons = {3: "moved", 8: "bumped"}
    some = every.without({8: "bumped"}).without({3: "moved"})
    write_campaign(some, tmp_path)
    assert len((tmp_path / "positions.csv").read_text().splitlines()) == 1 + every.n_positions
    read = read_campaign(tmp_path)
    assert read.positions.tolist() == [1, 2, 4, 5, 6, 7]
    assert read.reasons == reasons
    assert read.exclusions[0] == {"position": 3, "reason": "moved"}
    assert_same(read, some)
    kept = read.positions - 1
    for name in ("step_x", "temperature", "yaw", "roll", "order"):
        np.testing.assert_allclose(
            getattr(read.hold, name), getattr(every.hold, name)[kept], atol=1e-12
        )
    np.testing.assert_allclose(read.hold.lagged(20), every.hold.lagged(20)[kept], atol=1e-12)
    untimed = every.with_arrays(time=None).without(reasons)
    assert untimed.hold.order.tolist() == [1, 2, 4, 5, 6, 7]


def test_other_values_are_those_of_the_holds_that_are_used():
    some = campaign({"excluded": [{"position": 3, "reason": "moved"}]})
    changed = some.with_arrays(time=np.arange(7.0), forces=2 * some.forces, yaw=None)
    assert changed.holds["time"].tolist() == [0, 1, 20, 2, 3, 4, 5, 6]
    np.testing.assert_array_equal(changed.forces, 2 * some.forces)
    assert changed.yaw is None
    assert some.yaw is not None
    assert campaign().with_sigma(None).sigma_force is None


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
    header = {
        "name": draw(texts.filter(bool)), "sensor": maybe(draw(texts)), "unit": unit,
        "gravity": {"value_mps2": gravity, "sigma_mps2": draw(st.just(0.0) | floats(1e-9, 1e-3))},
        "sensor_noise": maybe({"sigma_mps2": draw(floats(1e-6, 1))}),
        "robot": {"angle_sigma_mgon": draw(st.just(0.0) | floats(1e-6, 60))} if robot else None,
        "range_mps2": maybe(draw(floats(20, 200))),
        "nominal": {"scale": [*scale], "offset": [*offset]} if unit == "counts" else None,
    }  # fmt: skip
    return Campaign.of(
        header,
        positions=np.cumsum(rng.integers(1, 3, n)), forces=forces,
        angles=np.column_stack([roll, pitch]) if robot else None,
        yaw=rng.normal(size=n) if robot else None, n_samples=maybe(rng.integers(1, 10**6, n)),
        sd=maybe(rng.uniform(0, 1, (n, 3))), time=maybe(np.cumsum(rng.uniform(0, 60, n))),
        temperature=maybe(rng.uniform(-40, 85, n)), vibration=maybe(rng.uniform(0, 1, n)),
    )  # fmt: skip


@given(campaigns())
def test_what_is_written_is_read_again(written):
    with TemporaryDirectory() as folder:
        write_campaign(written, folder)
        assert_same(read_campaign(folder), written)


def test_units_of_the_file(tmp_path):
    """g is standard gravity, whatever local gravity is; an sd in counts is positive."""
    text = "position,fx,fy,fz,sd_fx,sd_fy,sd_fz\n1,0.5,-1,0.1,1,1,1\n2,0,0,-1,2,2,2\n"
    (tmp_path / "positions.csv").write_text(text)
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
    given = campaign(yaw=None)
    write_campaign(given, tmp_path)
    for each in (given, read_campaign(tmp_path)):
        np.testing.assert_array_equal(each.hold.yaw, np.zeros(len(ROLL)))
    write_campaign(campaign({"robot": None}, angles=None, yaw=None), tmp_path)
    assert read_campaign(tmp_path).hold.yaw is None


def test_tolerated_ways_of_writing_csv(tmp_path):
    """A byte order mark, line ends of Windows, blanks, empty lines."""
    write_campaign(campaign(), tmp_path)
    path = tmp_path / "positions.csv"
    text = path.read_text().replace(",", " , ").replace("\n", "\r\n\r\n")
    path.write_bytes(b"\xef\xbb\xbf" + text.encode())
    assert_same(read_campaign(tmp_path), campaign())


POOR = {
    "level": {"angles": np.zeros((8, 2)), "forces": np.tile([0, 0, -G], (8, 1))},
    "nearly level": {"angles": np.full((8, 2), 1e-4), "forces": np.tile([0, 0, -G], (8, 1))},
    "poor": {"forces": 1.2 * campaign().forces + [1.0, -0.5, 0.7]},
}


@pytest.mark.parametrize("changes", POOR.values(), ids=POOR)
def test_what_a_calibration_is_for_is_no_error(tmp_path, changes):
    """Biases of 1 m/s², scales 20 % off; near level degrees, radians and gon are alike."""
    noise = np.random.default_rng(1).normal(0, 0.3, (8, 3))
    poor = campaign(**{**changes, "forces": changes["forces"] + noise})
    write_campaign(poor, tmp_path)
    assert_same(read_campaign(tmp_path), poor)


# --- other files, columns and keys ---------------------------------------------------------------


@cache
def sound():
    """Keys and columns of a campaign that can be read."""
    with TemporaryDirectory() as folder:
        write_campaign(campaign(), folder)
        header = yaml.safe_load(Path(folder, "campaign.yaml").read_text())
        return header, pd.read_csv(f"{folder}/positions.csv", dtype=str).to_dict("list")


def changed(folder, columns=(), **keys):
    """Write the campaign with other keys, and columns by a function of the old one; None is none.

    Return its table.
    """
    header, table = (dict(each) for each in sound())
    header |= keys
    for name, new in dict(columns).items():
        old = table.pop(name, ROLL)
        table |= {} if new is None else {name: new(old)}
    kept = {name: value for name, value in header.items() if value is not None}
    (folder / "campaign.yaml").write_text(yaml.safe_dump(kept))
    pd.DataFrame(table).to_csv(folder / "positions.csv", index=False)
    return table


def at(position, value):
    """Column with one other value."""
    return lambda old: [*old[: position - 1], value, *old[position:]]


def always(value):
    return lambda old: [value] * len(old)


def forces(new):
    return dict.fromkeys(("fx", "fy", "fz"), new)


def test_unknown_columns_are_named_and_left_out(tmp_path):
    changed(tmp_path, {"temperature_degc": always("20"), "note": always("x")})
    read = read_campaign(tmp_path)
    assert_same(replace(read, warnings=()), campaign())
    (warning,) = read.warnings
    assert "ignored: temperature_degc, note; did you mean 'temperature_degC'?" in warning


NO_NUMBER = ("abc", "9,8", "1_0", "", "nan", "1e999")


@pytest.mark.parametrize("name", KEYS)
def test_a_wrong_cell_of_any_column_is_said_with_its_place(tmp_path, name):
    """It is no number, or beyond the range of the column; or the whole column is missing."""
    (column,) = (each for each in COLUMNS.values() if name in each.keys)
    least, most = column.within.least, column.within.most
    beyond = {f"{value:.17g}": "must be from" for value in (least - 1, 2 * most)}
    whole = {"2.5": "is no whole number"} if column.whole else {}
    none = dict.fromkeys(NO_NUMBER, "is no number")
    for cell, part in (none | beyond | whole).items():
        changed(tmp_path, {name: at(3, cell)})
        place = "row 3" if name == "position" else "position 3"
        with refused(f"{tmp_path}/positions.csv: {name}: {place}: ", part):
            read_campaign(tmp_path)
    changed(tmp_path, {name: None})
    if column.needed or column.keys[1:]:
        with refused(f"{name}: the column is missing", *({*column.keys} - {name})):
            read_campaign(tmp_path)
    else:
        read_campaign(tmp_path)


def test_a_last_line_that_does_not_end_is_mentioned(tmp_path):
    """A cut in the last number cannot be seen otherwise."""
    changed(tmp_path)
    path = tmp_path / "positions.csv"
    path.write_text(path.read_text()[:-3])
    (warning,) = read_campaign(tmp_path).warnings
    assert "last line" in warning
