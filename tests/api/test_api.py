"""The functions for programs: the lines of the guide run, and bad input gets one line."""

import ast
import subprocess
import sys

import matplotlib
import numpy as np
import pandas as pd
import pytest
from places import ROOT

import accelstudy as acs
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


@pytest.mark.parametrize("name", ["log", "campaign", "calibration", "diagnosis", "plan", "result"])
def test_a_result_shows_itself_on_one_line_and_in_a_notebook(guide, name):
    assert len(repr(guide[name]).splitlines()) == 1
    if name not in ("log", "campaign"):
        assert "<table" in guide[name]._repr_html_()


@pytest.mark.parametrize("name", ["calibration", "diagnosis", "plan"])
def test_a_plot_goes_into_the_axes_that_are_given(guide, name):
    ax = matplotlib.figure.Figure().subplots()
    assert guide[name].plot(ax) is ax


def test_a_table_in_memory_is_a_log_as_a_file_is(guide):
    log = acs.read_log(logged(), rate=100, columns=COLUMNS)
    campaign = acs.find_holds(log, gravity="9.80795 m/s^2")
    assert np.allclose(campaign.forces, guide["campaign"].forces)


WRONG = {
    "acs.read_log(3)": "log: expected a path, not 3",
    "acs.read_log('none.csv')": "none.csv: no such file",
    "acs.read_log(table, rate='fast')": "rate_hz",
    "acs.read_log(table, columns=['ax'])": "columns: expected a mapping",
    "acs.find_holds({'fx': 1})": "log: expected a path",
    "acs.find_holds(acs.read_log(table, columns={'fx': 'a', 'fy': 'b', 'fz': 'c'}))": "'a'",
    "acs.find_holds(table, gravity='9.8')": "gravity: expected a number with its unit",
    "acs.read_campaign(None)": "folder: expected a path, not None",
    "acs.simulate_campaign(colour=1)": "colour: unknown key (known: name",
    "acs.calibrate('folder')": "campaign: expected a Campaign",
    "acs.diagnose({})": "campaign: expected a Campaign",
    "acs.plan(tilt_accuracy=1e-4)": "plan: give the sensor",
    "acs.plan(tilt_accuracy='10', sigma=0.002)": "tilt_accuracy: expected a number with its unit",
    "acs.simulate('m', 'mclaren-24', 'robot', sigma=1e-3)": "unknown",
    "acs.simulate('bias', 'mclaren-24', 'robot', sigma=None)": "sigma: expected a number",
}


@pytest.mark.parametrize("call", WRONG)
def test_wrong_input_gets_one_line(call):
    with pytest.raises(acs.InputError) as error:
        eval(call, {"acs": acs, "table": logged()})
    assert WRONG[call] in str(error.value)
    assert "\n" not in str(error.value)


def test_the_package_is_imported_without_the_libraries():
    code = "import sys, accelstudy; print({'numpy', 'pandas', 'scipy'} & set(sys.modules))"
    run = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert run.stdout.strip() == "set()"


def test_type_checkers_see_what_programs_get():
    tree = ast.parse((ROOT / "accelstudy/__init__.py").read_text(encoding="utf-8"))
    typed = {name.name for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)
             for name in node.names if node.module.startswith("accelstudy.")}  # fmt: skip
    assert typed == set(acs.__all__)
    assert all(getattr(acs, name) for name in acs.__all__)
