"""The verbs: what a user's few lines do, without a word of what lies below."""

import json
import pickle
import sys
import tempfile
from subprocess import run

import numpy as np
import pandas as pd
import pytest
import yaml
from calling import call, refusal, succeed
from matplotlib.figure import Figure
from places import ROOT
from scipy import stats

import accelstudy as acs
from accelstudy.files.tables import read_table


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
    return [acs.calibrate(folder / f"sensor-{i}") for i in range(4)]


@pytest.fixture(scope="module")
def results(folder, calibrations):
    """A result of each verb, with the command that gives the same."""
    for i, one in enumerate(calibrations):
        one.save(folder / f"calibrated-{i}")
    dates = ("2025-01-01", "2025-07-01", "2026-01-01")
    files = [folder / f"calibrated-{i}/calibration.json" for i in range(3)]
    two = [folder / f"sensor-{i}" for i in (1, 2)]
    return {
        "calibrate": (calibrations[0], ["calibrate", folder / "sensor-0"]),
        "diagnose": (
            acs.diagnose(folder / "sensor-1", replicates=100),
            ["diagnose", folder / "sensor-1", "--replicates", 100],
        ),
        "compare": (acs.compare(*calibrations[:2]), ["compare", *files[:2]]),
        "history": (
            acs.history(calibrations[:3], dates=dates, tilt_accuracy="50 mgon"),
            ["history", *files, *(word for d in dates for word in ("--date", d)),
             "--tilt-accuracy", "50mgon"],
        ),
        "lot": (acs.lot(two), ["lot", *two, "--cores", 2]),  # in one process, and in two
    }  # fmt: skip


@pytest.mark.parametrize("verb", ["calibrate", "diagnose", "compare", "history", "lot"])
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
    other = tmp_path / "other"
    other.mkdir()
    (other / "report.html").write_text("mine")
    with pytest.raises(acs.InputError, match="force"):
        result.save(other)


def test_results_of_a_lot_are_apart_from_the_campaigns_of_its_list(folder, tmp_path):
    listed = [{"campaign": str(folder / f"sensor-{i}")} for i in range(3)]
    batch = tmp_path / "batch.yaml"
    batch.write_text(json.dumps({"batch": "b", "campaigns": listed}), encoding="utf-8")
    for given in (batch, f"{folder}/sensor-*"):
        line = refusal("lot", given, "--out", folder / "sensor-1/lot")
        assert f"lies in the input {folder / 'sensor-1'}" in line
    assert not (folder / "sensor-1/lot").exists()


def test_a_function_gives_what_its_command_writes(tmp_path):
    """A campaign simulated, positions found, a log imported, leveled and described."""
    words = ("--scheme", "faces-6", "--model", "bias", "--sigma", "1mm/s^2", "--interval", "none")
    succeed("simulate-campaign", *words, "--out", tmp_path / "six", "--truth", tmp_path / "truth")
    six = acs.simulate_campaign(
        name="six", scheme="faces-6", model="bias", sigma=1e-3, interval=None
    )
    np.testing.assert_allclose(acs.read_campaign(tmp_path / "six").forces, six.forces, rtol=1e-13)
    assert yaml.safe_load((tmp_path / "truth").read_text(encoding="utf-8")) == six.truth

    words = ("--positions", 4, "--model", "bias", "--approach", "gravity", "--starts", 1)
    succeed("design", *words, "--roll", "-50gon", "50gon", "--out", tmp_path / "mine.yaml")
    found = acs.find_positions(
        positions=4, model="bias", approach="gravity", starts=1, roll=("-50gon", "50gon")
    )
    (tmp_path / "function").mkdir()
    found.save(tmp_path / "function/mine.yaml")
    assert found.verdict in found.summary()
    assert found.plot(Figure().subplots()).has_data()
    written = (tmp_path / name for name in ("mine.yaml", "function/mine.yaml"))
    assert len({path.read_bytes() for path in written}) == 1

    log, rng = tmp_path / "log.csv", np.random.default_rng(4)
    turned = np.repeat(six.forces, 400, axis=0) + 0.01 * rng.standard_normal((2400, 3))
    pd.DataFrame(turned.round(4), columns=["x", "y", "z"]).to_csv(log, index=False)
    how = {"rate": 100, "columns": {"fx": "x", "fy": "y", "fz": "z"}}
    words = ("--rate", 100, "--columns", "fx=x,fy=y,fz=z")
    succeed("import", log, *words, "--window", "500ms", "--no-figure", "--out", tmp_path / "found")
    holds = acs.find_holds(log, window=0.5, **how)
    kept = acs.read_campaign(tmp_path / "found")
    assert (kept.name, kept.n_positions) == (holds.name, 6)
    np.testing.assert_allclose(kept.forces, holds.forces, rtol=1e-13)

    one = acs.calibrate(holds, model="bias")
    one.save(tmp_path / "calibrated")
    file = tmp_path / "calibrated/calibration.json"
    succeed("apply", file, log, *words, "--sigma", 0.01, "--out", tmp_path / "leveled.parquet")
    leveled = pd.read_parquet(tmp_path / "leveled.parquet")
    pd.testing.assert_frame_equal(acs.apply(one, log, sigma=0.01, **how), leveled)
    pd.testing.assert_frame_equal(one.apply(acs.read_log(log, **how), sigma=0.01), leveled)

    succeed("data-sheet", tmp_path / "found", "--out", tmp_path / "sheet.yaml")
    sheet = acs.data_sheet(tmp_path / "found")
    sheet.save(tmp_path / "function/sheet.yaml")
    assert len({path.read_text() for path in tmp_path.rglob("sheet.yaml")}) == 1
    acs.write_campaign(kept, tmp_path / "function/found")
    with pytest.raises(acs.InputError, match="is not empty"):
        acs.write_campaign(kept, tmp_path / "function/found")
    assert acs.read_campaign(tmp_path / "function/found").forces.tolist() == kept.forces.tolist()
    said = call("advise", tmp_path / "six", "--tilt-accuracy", "1gon", "--model", "bias").stdout
    advice = acs.advise(tmp_path / "six", tilt_accuracy="1gon", model="bias")
    assert (said.strip(), advice.enough) == (advice.summary().strip(), True)
    assert advice.state == "enough"
    assert advice.verdict in said
    assert advice.to_frame().loc["roll", "wanted_rad"] == pytest.approx(np.pi / 200)
    assert advice.plot(Figure().subplots()).has_data()
    assert (advice.state in repr(advice), "<table" in advice._repr_html_()) == (True, True)
    advice.save(tmp_path / "advice")
    kept = json.loads((tmp_path / "advice/advice.json").read_text(encoding="utf-8"))
    assert (kept["state"], kept["positions"]) == ("enough", [*range(1, 7)])
    for range_ in (78.5, "78.5 m/s^2"):
        assert acs.find_holds(log, window=0.5, range=range_, **how).full_range == 78.5


@pytest.mark.parametrize("verb", ["calibrate", "diagnose", "compare", "history", "lot"])
def test_a_result_says_shows_and_draws_itself(results, verb):
    result, _ = results[verb]
    assert result.state in repr(result)
    assert len(repr(result).splitlines()) == 1
    text = result.summary()
    assert result.verdict in text
    assert len(result.to_frame()) > 0
    for name in result.to_frame().index[:3]:
        assert str(name) in text
    assert "<table" in result._repr_html_()
    ax = Figure().subplots()
    assert result.plot(ax) is ax
    assert ax.has_data()
    assert (result == result, len({result, result})) == (True, 1)


def test_intervals_and_covariance_are_those_of_the_estimates(calibrations, folder):
    one = calibrations[0]
    sigma = one.parameters["sigma"]
    np.testing.assert_allclose(np.diag(one.covariance), sigma**2)
    np.testing.assert_allclose(one.covariance, one.correlation * np.outer(sigma, sigma))
    half = (one.intervals(0.99)["high"] - one.intervals(0.99)["low"]) / 2
    np.testing.assert_allclose(half / sigma, stats.norm.ppf(0.995))
    assert list(one.intervals().columns) == ["low", "high", "unit"]
    # Without a stated sigma it is estimated from the residuals, with their redundancy.
    unknown = acs.simulate_campaign(seed=1, scheme="fibonacci-24", sigma=0.002, sigma_known=False)
    other = acs.calibrate(unknown, approach="gravity")
    half = (other.intervals(0.9)["high"] - other.intervals(0.9)["low"]) / 2
    wanted = stats.t.ppf(0.95, 24 - 9)
    np.testing.assert_allclose(half / other.parameters["sigma"], wanted)


def test_a_calibration_that_is_read_levels_as_before(calibrations, folder, results):
    one, read = calibrations[0], acs.read_calibration(folder / "calibrated-0")
    log = acs.read_log(
        pd.DataFrame(one.fit.campaign.forces, columns=["fx", "fy", "fz"]), rate=100,
        columns={axis: axis for axis in ("fx", "fy", "fz")},
    )  # fmt: skip
    pd.testing.assert_frame_equal(read.apply(log), one.apply(log))
    pd.testing.assert_frame_equal(read.covariance, one.covariance)
    assert (read.state, read.verdict) == (one.state, one.verdict)
    assert acs.compare(read, folder / "calibrated-0/calibration.json").state == "unchanged"
    assert (
        acs.export(read, form="matrix")
        == call("export", folder / "calibrated-0/calibration.json", "--form", "matrix").output
    )
    for ask in (lambda: read.residuals, read.tilt_error, read.plot):
        with pytest.raises(
            acs.InputError, match="a calibration that was read from a file has none"
        ):
            ask()


@pytest.fixture
def table(calibrations):
    """A log with an index of dates, two of which are the same, and a text of its owner."""
    forces = pd.DataFrame(calibrations[0].fit.campaign.forces, columns=["fx", "fy", "fz"])
    dates = pd.date_range("2026-01-31 10:00", periods=len(forces), freq="s", name="when")
    forces.index = dates.where(np.arange(len(dates)) != 7, dates[6])
    return forces.assign(note=[f"pose {i}" for i in range(len(forces))])


def test_a_table_that_is_leveled_keeps_its_index_and_columns(calibrations, table):
    leveled = calibrations[0].apply(table)
    pd.testing.assert_frame_equal(leveled[table.columns], table)
    added = leveled.columns.difference(table.columns)
    assert set(added) == {
        *(f"{axis}_calibrated_mps2" for axis in table.columns[:3]), "near_pole",
        *(f"{angle}gon" for angle in ("roll_", "pitch_", "sigma_roll_m", "sigma_pitch_m")),
    }  # fmt: skip
    # Its columns go beside others of the same index, those of a former leveling are replaced.
    pd.testing.assert_frame_equal(table.assign(**leveled[added])[leveled.columns], leveled)
    again = calibrations[0].apply(leveled)
    pd.testing.assert_frame_equal(again, leveled)
    by_number = table.set_axis([0, 1, 2, "note"], axis=1)
    log = acs.read_log(by_number, rate=1, columns={"fx": 0, "fy": 1, "fz": 2})
    by_number.iloc[:, :3] = 0.0  # a log is what it was when it was given
    other = calibrations[0].apply(log)
    assert list(other.columns[:4]) == [0, 1, 2, "note"]
    np.testing.assert_array_equal(other["roll_gon"], leveled["roll_gon"])


def test_a_table_in_memory_goes_through_no_file(calibrations, table, tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "none"))
    with pytest.raises(FileNotFoundError):
        tempfile.mkdtemp()
    monkeypatch.chdir(tmp_path)
    log = acs.read_log(table)
    assert len(calibrations[0].apply(log)) == len(table)
    assert len(calibrations[0].apply(pickle.loads(pickle.dumps(log)))) == len(table)
    assert not [*tmp_path.iterdir()]


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_tables_files_and_the_command_are_leveled_alike(results, folder, table, tmp_path, ending):
    table.iloc[3, 0] = np.nan
    path, out = tmp_path / f"log.{ending}", tmp_path / "out.parquet"
    written = table.reset_index()
    written.to_csv(path, index=False) if ending == "csv" else written.to_parquet(path)
    file = folder / "calibrated-0/calibration.json"
    succeed("apply", file, path, "--out", out)
    calibration = acs.read_calibration(file)
    of_command, of_file, of_table = (
        pd.read_parquet(out), calibration.apply(path), calibration.apply(table)
    )  # fmt: skip
    pd.testing.assert_frame_equal(of_file, of_command)
    numbers = of_table.columns.difference(["note"])
    pd.testing.assert_frame_equal(of_table[numbers].reset_index(drop=True), of_file[numbers])
    (warning,) = of_table.attrs["warnings"]
    assert "row 4, column fx" in warning


def test_the_tilt_error_is_that_of_the_report(calibrations):
    one = calibrations[0]
    stated = one.content["quality"]["tilt_rms_mgon"]
    found = one.tilt_error() / (np.pi / 200 * 1e-3)
    assert found.tolist() == pytest.approx([stated["roll"], stated["pitch"]])
    in_degrees, in_rad = one.tilt_error("45 deg"), one.tilt_error(np.pi / 4)
    assert in_degrees.tolist() == pytest.approx(in_rad.tolist())


def test_sigmas_are_checked_as_by_the_command(folder):
    table = acs.check_sigmas(folder / "sensor-0", replicates=200)
    assert table["ratio"].between(0.8, 1.25).all()


def test_catalogues_are_tables():
    for kind in ("effects", "noise effects", "gross errors", "models", "schemes", "approaches",
                 "data sheets"):  # fmt: skip
        table = acs.catalogue(kind)
        assert len(table) > 0
        assert table.index.is_unique
    assert "warm_up" in acs.catalogue("effects").index
    with pytest.raises(acs.InputError, match="unknown catalogue 'sensors'"):
        acs.catalogue("sensors")


@pytest.mark.parametrize(("line", "said"), [
    ("acs.calibrate(folder / 'none')", "none"),
    ("acs.read_calibration(folder)", "no such file"),
    ("acs.compare(calibrations[0], 3)", "second: expected what `calibrate`"),
    ("acs.compare(*calibrations[:2], tilt_range='5 s')", "tilt_range:"),
    ("acs.history(calibrations[:2])", "date"),
    ("acs.history(calibrations[:3])", "date: missing"),
    ("acs.history(calibrations[:3], dates=['2025-01-01'])", "1 date for 3 calibrations"),
    ("acs.lot([folder / 'sensor-0'])", "two sensors or more"),
    ("acs.diagnose(folder / 'sensor-0', replicates=3)", "replicates: must be from 100"),
    ("acs.export(calibrations[0], form='x')", "unknown form 'x'"),
    ("calibrations[0].intervals(2.0)", "level: expected a probability"),
    ("calibrations[0].save(3)", "folder: expected a path"),
])  # fmt: skip
def test_bad_input_is_one_line(line, said, folder, calibrations):
    with pytest.raises(acs.InputError, match=said) as refused:
        eval(line)
    assert "\n" not in str(refused.value)


def test_the_front_door_is_light_and_complete():
    """All names are there, and none of them is imported before it is asked for."""
    line = "import sys, accelstudy as a; print(len(a.__all__), 'numpy' in sys.modules)"
    found = run([sys.executable, "-c", line], capture_output=True, text=True, check=True).stdout
    assert found.split() == [str(len(acs.__all__)), "False"]
    for name in acs.__all__:
        assert getattr(acs, name).__doc__


def test_a_simulation_is_a_result_with_the_tables_of_a_study(tmp_path):
    result = acs.simulate("bias", "faces-6", ["gravity", "robot"], sigma="2mm/s^2", replicates=20)
    assert (result.state, result.name) == ("converged", "2 cells")
    assert [*result.to_frame()] == [*result.tilt]
    assert result.plot(Figure().subplots()).has_data()
    result.save(tmp_path / "simulated")
    written = {path.stem: read_table(path) for path in (tmp_path / "simulated").glob("*.parquet")}
    assert set(written) == set(result.tables)
    pd.testing.assert_frame_equal(written["summary"], result.tables["summary"])
    said = json.loads((tmp_path / "simulated/simulation.json").read_text(encoding="utf-8"))
    assert (said["state"], said["verdict"]) == (result.state, result.verdict)
    result.save(tmp_path / "simulated")  # the same again takes no `force`
    with pytest.raises(acs.InputError, match="is the folder of a simulation"):
        acs.calibrate(acs.simulate_campaign()).save(tmp_path / "simulated", force=True)
    # The tables of a study have the same names, and are no simulation to write over.
    (tmp_path / "simulated/simulation.json").unlink()
    with pytest.raises(acs.InputError, match="is not empty"):
        result.save(tmp_path / "simulated")


def test_files_of_the_first_versions_still_read():
    """A campaign and its calibration.json as 0.1.0 and 0.2.0 wrote them, byte for byte alike."""
    folder = ROOT / "tests/campaign/version_0_2"
    new = acs.calibrate(folder, model="bias-scale", approach="gravity")
    old = acs.read_calibration(folder)
    assert {"date", "axes", "sigmas_95"} <= {*new.content} - {*old.content}
    for table in ("parameters", "covariance", "correlation"):
        pd.testing.assert_frame_equal(getattr(old, table), getattr(new, table), rtol=1e-9)
    assert (old.state, acs.compare(old, new).state) == (new.state, "unchanged")
    log = pd.DataFrame(new.fit.campaign.forces, columns=["fx", "fy", "fz"])
    how = {"rate": 1, "columns": {axis: axis for axis in log}}
    pd.testing.assert_frame_equal(acs.apply(old, log, **how), acs.apply(new, log, **how))
    assert acs.export(old, form="c").startswith("/*")
