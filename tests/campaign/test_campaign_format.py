"""The campaign format: what is written is read again, and what is wrong ends in one clear line."""

from dataclasses import fields, replace
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

from accelstudy.basics.errors import InputError, printable_line
from accelstudy.basics.units import GON, MGON, STANDARD_GRAVITY
from accelstudy.campaign.format import read_campaign, write_campaign
from accelstudy.campaign.header import COLUMNS, KNOWN, LogLayout
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
    assert_same(read.with_left_out, every)
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
    write_campaign(campaign(yaw=None), tmp_path)
    np.testing.assert_array_equal(read_campaign(tmp_path).yaw, np.zeros(len(ROLL)))
    write_campaign(campaign(angles=None, sigma_angle=None, yaw=None), tmp_path)
    assert read_campaign(tmp_path).yaw is None


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


@pytest.mark.parametrize(("changes", "part"), [
    ({"name": "\ud800"}, "name"),
    ({"unit": "counts"}, "nominal"),
    ({"forces": np.full((8, 3), np.nan)}, "nan is no number"),
    ({"time": np.arange(7)}, r"time: shape \(7,\), not \(8,\)"),
    ({"angles": None}, "yaw"),
    ({"sigma_angle": None}, "robot"),
])  # fmt: skip
def test_what_could_not_be_read_again_is_not_written(tmp_path, changes, part):
    with pytest.raises(InputError, match=part):
        write_campaign(campaign(**changes), tmp_path / "folder")
    assert not (tmp_path / "folder").exists()


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
    first, second = read.warnings
    assert "'temperature_degc'" in first
    assert "did you mean 'temperature_degC'" in first
    assert "'note'" in second


NO_NUMBER = ("abc", "9,8", "1_0", "", "nan", "1e999")


@pytest.mark.parametrize("name", KNOWN)
def test_a_wrong_cell_of_any_column_is_said_with_its_place(tmp_path, name):
    """It is no number, or beyond the range of the column; or the whole column is missing."""
    (column,) = (each for each in COLUMNS.values() if name in each.names)
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
    if column.needed or column.names[1:]:
        with refused(f"{name}: the column is missing", *({*column.names} - {name})):
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
