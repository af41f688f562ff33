"""What verbs return: it says, shows, draws and saves itself, and is what the command gives."""

import json
import pickle
import sys
from copy import copy
from subprocess import run

import matplotlib
import numpy as np
import pandas as pd
import pytest
from calling import call, succeed
from jsonschema import Draft202012Validator
from log_helpers import session
from matplotlib import pyplot
from matplotlib.figure import Figure
from places import ROOT
from scipy import stats
from usual import compare_few

import accelstudy as acs
from accelstudy.campaign.calibration.file_format import CalibrationDocument
from accelstudy.drawing.style import in_style
from accelstudy.epochs.file_format import HistoryDocument
from accelstudy.files.documents import json_text
from accelstudy.lots.file_format import LotDocument
from accelstudy.planning.plan import PlanDocument
from accelstudy.schemes import get_scheme
from accelstudy.sequential.advice import AdviceDocument
from accelstudy.study.result import SimulationDocument

matplotlib.use("agg")
BIAS = (0.05, 0.01, 0.03)
HOW = {"rate": 100, "columns": {"fx": "ax", "fy": "ay", "fz": "az"}}
VERBS = ("calibrate", "diagnose", "compare", "history", "lot")


def logged():
    """A log of 24 holds, shaken before each, of a sensor with a known bias."""
    held = -9.80795 * get_scheme("fibonacci-24").directions + BIAS
    readings, _ = session(sigma=0.005, moving=100, forces=held)
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
        compare_few(patch)
        exec(compile(source, "python_example.py", "exec"), names)
    return {**names, "folder": folder}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Four campaigns of sensors of one type, of which three have a quadratic scale."""
    root = tmp_path_factory.mktemp("verbs")
    for i, effects in enumerate([(), *[("quadratic_scale: 0.004, -0.004, 0.004",)] * 3]):
        campaign = acs.simulate_campaign(
            name=f"sensor-{i}", seed=i, scheme="fibonacci-24", effects=effects, sigma=0.002
        )
        acs.write_campaign(campaign, root / f"sensor-{i}")
    return root


@pytest.fixture(scope="module")
def calibrations(folder):
    made = [acs.calibrate(folder / f"sensor-{i}") for i in range(4)]
    for i, one in enumerate(made):
        one.save(folder / f"calibrated-{i}")
    return made


@pytest.fixture(scope="module")
def results(folder, calibrations):
    """A result of each verb, with the command that gives the same."""
    dates = ("2025-01-01", "2025-07-01", "2026-01-01")
    files = [folder / f"calibrated-{i}/calibration.json" for i in range(3)]
    two = [folder / f"sensor-{i}" for i in (1, 2)]
    return {
        "calibrate": (calibrations[0], ["calibrate", folder / "sensor-0"]),
        "diagnose": (acs.diagnose(folder / "sensor-1"), ["diagnose", folder / "sensor-1"]),
        "compare": (acs.compare(*calibrations[:2]), ["compare", *files[:2]]),
        "history": (
            acs.history(calibrations[:3], dates=dates, tilt_accuracy="50 mgon"),
            ["history", *files, *(word for d in dates for word in ("--date", d)),
             "--tilt-accuracy", "50mgon"],
        ),
        "lot": (acs.lot(two), ["lot", *two, "--cores", 2]),  # in one process, and in two
    }  # fmt: skip


@pytest.fixture(scope="module")
def every(guide, results):
    """Each kind of result."""
    return {
        **{name: guide[name] for name in ("log", "campaign", "plan", "result")},
        **{verb: result for verb, (result, _) in results.items()},
        "design": acs.find_positions(
            positions=4, model="bias", approach="gravity", starts=1, roll=("-50gon", "50gon")
        ),
        "advise": acs.advise(guide["campaign"], tilt_accuracy="1gon", model="bias"),
        "data-sheet": acs.data_sheet(guide["folder"] / "imu.csv", **HOW),
        "simulate": acs.simulate("bias", ["faces-6", "mclaren-24"], "robot", sigma=1e-3),
    }


@pytest.mark.parametrize("name", [
    *("log", "campaign", "plan", "result", *VERBS, "design", "advise", "data-sheet")
])  # fmt: skip
def test_a_result_says_shows_and_draws_itself_and_is_equal_to_itself_alone(every, name):
    one, other = every[name], copy(every[name])
    assert len(repr(one)) <= 100
    assert "\n" not in repr(one)
    assert "<table" in one._repr_html_()
    again = pickle.loads(pickle.dumps(one))
    assert (repr(again), again._repr_html_()) == (repr(one), one._repr_html_())
    assert (one == one, one == other, len({one, other})) == (True, False, 2)
    if name in ("log", "campaign"):
        return
    assert one.state in repr(one)
    assert f", {one.state}</b>" in one._repr_html_()
    assert one.verdict in one.summary()
    assert len(one.to_frame()) > 0
    for row in one.to_frame().index[:3] if name in VERBS else ():
        assert str(row) in one.summary()
    given = Figure().subplots()
    assert one.plot(given) is given
    assert given.has_data()
    with matplotlib.rc_context({"interactive": True, "backend": "agg", "text.usetex": True}):
        ax = one.plot()
        assert matplotlib.is_interactive()
    looks = {(label.get_fontsize(), label.get_usetex()) for label in ax.get_xticklabels()}
    with in_style():
        assert looks == {(matplotlib.rcParams["xtick.labelsize"], False)}
    assert not ax.spines["top"].get_visible()
    pyplot.close(ax.figure)


@pytest.mark.parametrize("verb", VERBS)
def test_a_function_and_its_command_write_the_same(results, verb, tmp_path):
    result, command = results[verb]
    result.save(tmp_path / "function")
    answer = succeed(*command, "--out", tmp_path / "command")
    assert result.verdict.split(". ")[0] in answer.output
    names = [
        sorted(p.relative_to(tmp_path / way).as_posix() for p in (tmp_path / way).rglob("*.*"))
        for way in ("function", "command")
    ]
    assert names[0] == names[1]
    for name in (name for name in names[0] if name.endswith(".json")):
        ways = (tmp_path / way / name for way in ("function", "command"))
        function, written = (json.loads(path.read_text()) for path in ways)
        assert function == written, name
    for name in (name for name in names[0] if name.endswith(".parquet")):
        tables = (pd.read_parquet(tmp_path / way / name) for way in ("function", "command"))
        pd.testing.assert_frame_equal(*tables)
    other = tmp_path / "other"
    other.mkdir()
    (other / "report.html").write_text("mine")
    with pytest.raises(acs.InputError, match="force"):
        result.save(other)


def strict(schema):
    """Let a schema take all keys that it describes, and no others."""
    if isinstance(schema, list):
        return [strict(each) for each in schema]
    if not isinstance(schema, dict):
        return schema
    content = {key: strict(value) for key, value in schema.items()}
    if "properties" in schema and "type" in schema:
        content |= {"required": [*schema["properties"]]}
        content |= {"additionalProperties": False}
    return content


@pytest.mark.parametrize(("name", "document"), [
    ("calibrate", CalibrationDocument), ("compare", HistoryDocument), ("history", HistoryDocument),
    ("lot", LotDocument), ("advise", AdviceDocument), ("simulate", SimulationDocument),
    ("plan", PlanDocument),
])  # fmt: skip
def test_each_key_of_a_result_is_described(every, name, document):
    content = json.loads(json_text(every[name].content))
    if name == "lot":
        content["files"] = []  # of a lot that is written
    schema = Draft202012Validator(strict(document.model_json_schema()))
    assert [error.message for error in schema.iter_errors(content)] == []
    assert document.check(content).model_dump(exclude_unset=True, by_alias=True) == content


# --- a calibration -------------------------------------------------------------------------------


def test_the_unit_of_angles_is_that_of_the_environment(guide, monkeypatch):
    monkeypatch.setenv("ACCELSTUDY_ANGLE_UNIT", "deg")
    assert {"roll_deg", "sigma_pitch_mdeg"} <= {*guide["calibration"].apply(logged())}
    monkeypatch.setenv("ACCELSTUDY_ANGLE_UNIT", "grad")
    with pytest.raises(acs.InputError, match="'grad' is no unit of angles; choose gon or deg"):
        guide["calibration"].apply(logged())


def test_intervals_and_covariance_are_those_of_the_estimates(calibrations):
    one = calibrations[0]
    sigma = one.parameters["sigma"]
    np.testing.assert_allclose(np.diag(one.covariance), sigma**2)
    np.testing.assert_allclose(one.covariance, one.correlation * np.outer(sigma, sigma))
    # Without a stated sigma it is estimated from the residuals, with their redundancy.
    unknown = acs.simulate_campaign(seed=1, scheme="fibonacci-24", sigma=0.002, sigma_known=False)
    other = acs.calibrate(unknown, approach="gravity")
    for made, level, wanted in ((one, 0.99, stats.norm), (other, 0.9, stats.t(24 - 9))):
        intervals = made.intervals(level)
        assert [*intervals] == ["low", "high", "unit"]
        half = (intervals["high"] - intervals["low"]) / 2
        np.testing.assert_allclose(half / made.parameters["sigma"], wanted.ppf((1 + level) / 2))


def test_a_calibration_that_is_read_is_as_before(calibrations, folder):
    (one, other), path = calibrations[:2], folder / "calibrated-0"
    read, columns = acs.read_calibration(path), ["fx", "fy", "fz"]
    forces = pd.DataFrame(one.fit.campaign.forces, columns=columns)
    log = acs.read_log(forces, rate=100, columns={axis: axis for axis in columns})
    pd.testing.assert_frame_equal(read.apply(log), one.apply(log))
    pd.testing.assert_frame_equal(read.covariance, one.covariance)
    assert (read.state, read.verdict) == (one.state, one.verdict)
    assert acs.compare(read, path / "calibration.json").state == "unchanged"
    assert acs.compare(read, other).content == acs.compare(one, other).content
    printed = call("export", path / "calibration.json", "--form", "matrix").output
    assert acs.export(read, form="matrix") == printed


def test_files_of_the_first_versions_still_read():
    """A campaign and its calibration.json as 0.1.0 and 0.2.0 wrote them, byte for byte alike."""
    folder = ROOT / "tests/campaign/version_0_2"
    new = acs.calibrate(folder, model="bias-scale", approach="gravity")
    old = acs.read_calibration(folder)
    assert (old.content["date"], old.content["sigmas_95"]) == (None, None)
    for table in ("parameters", "covariance", "correlation"):
        pd.testing.assert_frame_equal(getattr(old, table), getattr(new, table), rtol=1e-9)
    assert (old.state, acs.compare(old, new).state) == (new.state, "unchanged")
    log = pd.DataFrame(new.fit.campaign.forces, columns=["fx", "fy", "fz"])
    how = {"rate": 1, "columns": {axis: axis for axis in log}}
    pd.testing.assert_frame_equal(acs.apply(old, log, **how), acs.apply(new, log, **how))
    assert acs.export(old, form="c").startswith("/*")


# --- the front door ------------------------------------------------------------------------------


def test_the_front_door_is_light_and_complete():
    """All names are there, for type checkers, too, and none is imported before it is asked for."""
    line = "import sys, accelstudy as a; print(len(a.__all__), 'numpy' in sys.modules)"
    found = run([sys.executable, "-c", line], capture_output=True, text=True, check=True).stdout
    assert found.split() == [str(len(acs.__all__)), "False"]
    source = (ROOT / "accelstudy/__init__.pyi").read_text(encoding="utf-8")
    for name in acs.__all__:
        assert getattr(acs, name).__doc__
        assert f" import {name} as {name}\n" in source


@pytest.mark.parametrize("table", ["campaign.holds", "log.samples", "calibration.residuals",
                                   "diagnosis.positions", "result.estimates"])  # fmt: skip
def test_a_table_that_was_read_is_not_changed_by_its_reader(guide, table):
    name, _, attribute = table.partition(".")
    before = getattr(guide[name], attribute)
    changed = getattr(guide[name], attribute)
    changed.iloc[0, 1] = 0
    changed["new"] = 1
    pd.testing.assert_frame_equal(getattr(guide[name], attribute), before)


# --- what a program gives ------------------------------------------------------------------------


def test_numbers_may_be_those_of_numpy(guide):
    campaign = acs.simulate_campaign(sigma=np.array(0.003), sigma_known=np.True_)
    assert campaign.sigma_force == 0.003
    intervals = guide["calibration"].intervals
    assert intervals(np.float32(0.5)).equals(intervals("50%"))
    dates = np.array(["2025-01-01", "2026-01-01"], "datetime64[D]")
    both = [acs.calibrate(acs.simulate_campaign(seed=seed)) for seed in (1, 2)]
    assert [date.year for date in acs.history(both, dates=dates).dates] == [2025, 2026]


def test_a_summary_has_no_empty_table(guide):
    assert guide["diagnosis"].summary().endswith(guide["diagnosis"].verdict)
