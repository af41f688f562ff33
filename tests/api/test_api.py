"""The functions for programs: the lines of the guide run, and bad input gets one line."""

import ast
from copy import copy
from datetime import UTC, datetime

import matplotlib
import numpy as np
import pandas as pd
import pytest
import yaml
from matplotlib import pyplot
from places import ROOT
from study_helpers import grid, run_study

import accelstudy as acs
from accelstudy.basics.given import quantity
from accelstudy.basics.units import UNITS, Given
from accelstudy.drawing.style import STYLE
from accelstudy.epochs.history import history_of
from accelstudy.schemes import get_scheme

matplotlib.use("agg")
BIAS = (0.05, 0.01, 0.03)
COLUMNS = {"fx": "ax", "fy": "ay", "fz": "az"}


def logged():
    """A log of 24 holds with a turn before each, of a sensor with a known bias."""
    rng = np.random.default_rng(1)
    forces = -9.80795 * get_scheme("fibonacci-24").directions
    rows = []
    for before, after in zip(np.roll(forces, 1, axis=0), forces, strict=True):
        rows += [np.linspace(before, after, 100), np.tile(after, (400, 1))]
    readings = np.concatenate(rows) + BIAS
    readings += 0.005 * rng.standard_normal(readings.shape)
    return pd.DataFrame(readings, columns=["ax", "ay", "az"])


@pytest.fixture(scope="module")
def guide(tmp_path_factory):
    """What the names of the guide's lines stand for after they have run."""
    folder = tmp_path_factory.mktemp("guide")
    logged().to_csv(folder / "imu.csv", index=False)
    source = (ROOT / "docs/guides/python_example.py").read_text(encoding="utf-8")
    names = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        exec(compile(source, "python_example.py", "exec"), names)
    return {**names, "folder": folder}


def test_the_calibration_finds_the_bias(guide):
    parameters = guide["calibration"].parameters
    found = parameters.loc[["b_x", "b_y", "b_z"]]
    assert (abs(found["value"] - np.array(BIAS)) < 4 * found["sigma"]).all()
    assert (guide["folder"] / "calibrated/calibration.json").exists()
    assert len(guide["leveled"]) == len(logged())
    log = acs.read_log(logged(), rate=100, columns=COLUMNS)
    louder = guide["calibration"].apply(log, sigma="50 mm/s^2")
    assert (louder["sigma_roll_mgon"] > 2 * guide["leveled"]["sigma_roll_mgon"]).all()
    with pytest.raises(acs.InputError, match="sigma: expected a number, as 2mm"):
        guide["calibration"].apply(log, sigma="loud")


@pytest.mark.parametrize("name", ["log", "campaign", "calibration", "diagnosis", "plan", "result"])
def test_a_result_shows_itself_on_one_line_and_is_equal_to_itself_alone(guide, name):
    one, other = guide[name], copy(guide[name])
    assert len(repr(one)) <= 100
    assert "\n" not in repr(one)
    assert "<table" in one._repr_html_()
    assert (one == one, one == other) == (True, False)
    assert len({one, other}) == 2


def test_calibrations_are_compared_and_followed_as_they_are_returned(guide):
    one, folder = guide["calibration"], guide["folder"]
    read = acs.read_calibration(folder / "calibrated/calibration.json")
    other = acs.calibrate(guide["campaign"], model="bias-scale")
    as_returned, as_read = (acs.compare(each, other).result for each in (one, read))
    assert as_returned.model.name == "bias-scale"
    np.testing.assert_array_equal(as_returned.values, as_read.values)
    assert as_returned.change.test() == as_read.change.test()
    dates = [datetime(2025, month, 1, tzinfo=UTC) for month in (1, 4, 7)]
    assert len(history_of([each.sensor for each in (one, other, read)], dates).calibrations) == 3
    with pytest.raises(acs.InputError, match="second: expected what `calibrate` or"):
        acs.compare(one, 3)


def test_the_unit_of_angles_is_that_of_the_environment(guide, monkeypatch):
    monkeypatch.setenv("ACCELSTUDY_ANGLE_UNIT", "deg")
    leveled = guide["calibration"].apply(logged(), sigma=0.005)
    assert {"roll_deg", "sigma_pitch_mdeg"} <= set(leveled)
    monkeypatch.setenv("ACCELSTUDY_ANGLE_UNIT", "grad")
    with pytest.raises(acs.InputError, match="'grad' is no unit of angles; choose gon or deg"):
        guide["calibration"].apply(logged(), sigma=0.005)


@pytest.mark.parametrize("unit", UNITS)
def test_a_quantity_is_a_number_in_si_or_a_text_with_its_unit(unit):
    """Also where the unit begins with a digit, as 1/K does."""
    given = Given(unit, "", -np.inf)
    for number in (0.25, 2e-4, -3, np.float64(1e-9)):
        assert quantity("x", number, given) == number
    for name, size in UNITS[unit].items():
        assert quantity("x", f"2 {name}", given) == 2 * size


def test_a_truth_is_in_si_or_with_its_unit():
    given = {"model": "bias-scale", "scheme": "faces-6", "approach": "robot"}
    given |= {"sigma": 1e-3, "replicates": 2}
    numbers, texts = (
        acs.simulate(**given, truth=truth).parameters
        for truth in ({"s_x": 2e-4, "b_y": -0.05}, {"s_x": "200 ppm", "b_y": "-50 mm/s^2"})
    )
    pd.testing.assert_frame_equal(numbers, texts)
    assert numbers.loc[["s_x", "b_y"], "truth"].tolist() == [2e-4, -0.05]


@pytest.mark.parametrize("name", ["calibration", "diagnosis", "plan"])
def test_a_plot_goes_into_the_axes_that_are_given_or_has_the_style_of_all_figures(guide, name):
    with matplotlib.rc_context({"interactive": True, "backend": "agg"}):
        given = matplotlib.figure.Figure().subplots()
        assert guide[name].plot(given) is given
        ax = guide[name].plot()
        assert matplotlib.is_interactive()
    assert {label.get_fontsize() for label in ax.get_xticklabels()} == {STYLE["xtick.labelsize"]}
    assert not ax.spines["top"].get_visible()
    pyplot.close(ax.figure)


def test_a_table_in_memory_is_a_log_as_a_file_is(guide):
    log = acs.read_log(logged(), rate=100, columns=COLUMNS)
    campaign = acs.find_holds(log, gravity="9.80795 m/s^2")
    assert np.allclose(campaign.forces, guide["campaign"].forces)
    assert campaign.notes[0].startswith("log: ")
    assert (repr(log), campaign.name) == ("Log('DataFrame', columns, rate_hz)", "DataFrame")


def test_a_study_in_memory_has_the_numbers_of_one_of_the_workflow(tmp_path):
    scheme, given = tmp_path / "mine.yaml", ["fibonacci-9", str(tmp_path / "mine.yaml")]
    directions = (-get_scheme("fibonacci-12").directions).tolist()
    scheme.write_text(yaml.safe_dump({"scheme": "mine", "directions": directions}))
    result = acs.simulate(
        ["bias", "bias-scale"], given, ["gravity", "robot"], sigma=["3 mm/s^2", 0.001],
        robot_sigma="3.2 mgon", truth={"b_x": 0.05, "s_y": "200 ppm"}, replicates=40,
    )  # fmt: skip
    written = run_study(
        tmp_path,
        noise={"sensor": {"sigma_mps2": 0.003}},
        sensor={
            "bias": {"value": [0.05, 0, 0], "unit": "m/s^2"},
            "scale": {"value": [0, 200, 0], "unit": "ppm"},
        },
        grids=[
            grid(["bias", "bias-scale"], given, replicates=40, sensor_sigma_mps2=[0.003, 0.001])
        ],
    )
    for name, table in result.tables.items():
        pd.testing.assert_frame_equal(table, written[name], check_dtype=False, rtol=1e-9)
    kept, estimates = written["estimates"], result.estimates["estimate"].to_numpy()
    assert np.array_equal(estimates[np.isfinite(estimates)], kept["estimate"].to_numpy())


def test_every_calibration_of_a_study_is_in_a_dataset():
    result = acs.simulate(
        ["bias", "bias-scale-nonorthogonality"], "faces-6", "gravity", sigma=0.002, replicates=50
    )
    found = result.estimates
    assert dict(found.sizes) == {"cell": 2, "replicate": 50, "parameter": 9, "angle": 2}
    assert found["unit"].to_series()[["b_x", "s_y"]].tolist() == ["m/s^2", "1"]
    assert found["tilt"].attrs["units"] == "rad"
    bias, undetermined = found["estimate"]
    assert np.isfinite(bias).sum("replicate").to_series().to_dict() == {
        name: 50 if name.startswith("b_") else 0 for name in found["parameter"].to_numpy()
    }
    assert (~np.isfinite(undetermined)).all()
    assert result.tables["cells"]["reason"].str.len().astype(bool).tolist() == [False, True]
    first = result.parameters.loc[result.cells[0].name]
    assert np.allclose(bias.std("replicate")[:3], first["sd"], rtol=0.4)
    rms = np.sqrt((found["tilt"][0] ** 2).mean("replicate"))
    assert np.allclose(rms, result.tilt.loc[result.cells[0].name, "rms"], rtol=0.4)


def test_what_reading_refuses_is_diagnosed(tmp_path):
    given = acs.simulate_campaign(scheme="fibonacci-24", gross_errors="unit_error(force=0.102)")
    acs.write_campaign(given, tmp_path, plausible=False)
    with pytest.raises(acs.InputError, match="look like g"):
        acs.read_campaign(tmp_path)
    assert acs.diagnose(acs.read_campaign(tmp_path, plausible=False)).state == "gross_error"


WRONG = {
    "acs.read_log(3)": "log: expected a path or a DataFrame, not 3",
    "acs.read_log('none.csv')": "none.csv: no such file",
    r"acs.read_log('\0')": "no name of a file",
    r"acs.read_log('a\ud800')": "no name of a file",
    "acs.read_log('x' * 5000)": "too long for the name of a file",
    "acs.read_log(table, rate='fast')": "rate: expected a number, as 2Hz",
    "acs.read_log(table, columns=['ax'])": "columns: expected a mapping",
    "acs.find_holds({'fx': 1})": "log: expected a path",
    "acs.find_holds(acs.read_log(table, columns={'fx': 'a', 'fy': 'b', 'fz': 'c'}))": "'a'",
    "acs.read_campaign(None)": "folder: expected a path, not None",
    "acs.read_log(table.assign(note=[1, 'x'] * 6000))": "log: the DataFrame cannot be a log",
    "acs.find_holds(table / 9.8)": "DataFrame: which column is time?",
    "acs.find_holds(acs.read_log(table / 9.8, rate=100))": "g, not m/s^2; give `unit` g",
    "acs.simulate_campaign(effects=3)": "effects: expected the name of an effect",
    "acs.calibrate(3)": "campaign: expected a Campaign",
    "acs.diagnose({})": "campaign: expected a Campaign",
    "acs.plan(tilt_accuracy=1e-4)": "plan: give the sensor",
    "acs.plan(tilt_accuracy=1e-4, sigma=1, max_positions=3)": "max_positions: must be from 4",
    "acs.plan(tilt_accuracy=1e-4, sigma=1, schemes=3)": "schemes: expected the name of a scheme",
    "acs.simulate('m', 'mclaren-24', 'robot', sigma=1e-3)": "unknown",
    "acs.simulate('bias', 'mclaren-24', 'robot', sigma=None)": "sigma: expected a number",
    "acs.simulate('bias', [], 'robot', sigma=1e-3)": "scheme: none is given",
    "acs.simulate('bias', 'faces-6', 'robot', sigma=1, truth={'s_x': 1})": "parameter of the truth",
    "acs.simulate('bias', 'faces-6', 'robot', sigma=1, truth={'b_x': ''})": "truth: b_x: expected",
    "acs.simulate('bias', 'faces-6', 'robot', sigma=1, replicates=1)": "replicates: must be from 2",
}


@pytest.mark.parametrize("call", WRONG)
def test_wrong_input_gets_one_line(call):
    with pytest.raises(acs.InputError) as error:
        eval(call, {"acs": acs, "table": logged()})
    assert WRONG[call] in str(error.value)
    assert "\n" not in str(error.value)


def test_type_checkers_see_what_programs_get():
    tree = ast.parse((ROOT / "accelstudy/__init__.py").read_text(encoding="utf-8"))
    typed = {name.name for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)
             for name in node.names if node.module.startswith("accelstudy.")}  # fmt: skip
    assert typed == set(acs.__all__)
    assert all(getattr(acs, name) for name in acs.__all__)
