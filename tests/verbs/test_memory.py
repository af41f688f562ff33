"""Logs and studies in memory: tables in and out, and no file between."""

import json

import numpy as np
import pandas as pd
import pytest
import yaml
from calling import succeed
from study_helpers import grid, run_study

import accelstudy as acs
from accelstudy.files.tables import read_table
from accelstudy.schemes import get_scheme


@pytest.fixture(scope="module")
def calibration():
    return acs.calibrate(acs.simulate_campaign(seed=0, scheme="fibonacci-24", sigma=0.002))


@pytest.fixture
def table(calibration):
    """A log with an index of dates, two of which are the same, and a text of its owner."""
    forces = pd.DataFrame(calibration.fit.campaign.forces, columns=["fx", "fy", "fz"])
    dates = pd.date_range("2026-01-31 10:00", periods=len(forces), freq="s", name="when")
    forces.index = dates.where(np.arange(len(dates)) != 7, dates[6])
    return forces.assign(note=[f"pose {i}" for i in range(len(forces))])


def test_a_table_that_is_leveled_keeps_its_index_and_columns(calibration, table):
    leveled = calibration.apply(table)
    pd.testing.assert_frame_equal(leveled[table.columns], table)
    added = leveled.columns.difference(table.columns)
    assert set(added) == {
        *(f"{axis}_calibrated_mps2" for axis in table.columns[:3]), "near_pole",
        *(f"{angle}gon" for angle in ("roll_", "pitch_", "sigma_roll_m", "sigma_pitch_m")),
    }  # fmt: skip
    # Its columns go beside others of the same index, those of a former leveling are replaced.
    pd.testing.assert_frame_equal(table.assign(**leveled[added])[leveled.columns], leveled)
    pd.testing.assert_frame_equal(calibration.apply(leveled), leveled)
    by_number = table.set_axis([0, 1, 2, "note"], axis=1)
    log = acs.read_log(by_number, rate=1, columns={"fx": 0, "fy": 1, "fz": 2})
    assert repr(log) == "Log('DataFrame', columns, rate)"
    by_number.iloc[:, :3] = 0.0  # a log is what it was when it was given
    other = calibration.apply(log)
    assert list(other.columns[:4]) == [0, 1, 2, "note"]
    np.testing.assert_array_equal(other["roll_gon"], leveled["roll_gon"])


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_tables_files_and_the_command_are_leveled_alike(calibration, table, tmp_path, ending):
    table.iloc[3, 0] = np.nan
    path, out = tmp_path / f"log.{ending}", tmp_path / "out.parquet"
    written = table.reset_index()
    written.to_csv(path, index=False) if ending == "csv" else written.to_parquet(path)
    calibration.save(tmp_path / "calibrated")
    succeed("apply", tmp_path / "calibrated/calibration.json", path, "--out", out)
    of_command, of_file, of_table = (
        pd.read_parquet(out).astype({"near_pole": "boolean"}),
        calibration.apply(path),
        calibration.apply(table),
    )  # fmt: skip
    pd.testing.assert_frame_equal(of_file, of_command)
    numbers = of_table.columns.difference(["note"])
    pd.testing.assert_frame_equal(of_table[numbers].reset_index(drop=True), of_file[numbers])
    assert len(of_table[~of_table["near_pole"]]) == len(table) - 1
    (warning,) = of_table.attrs["warnings"]
    assert "row 4, column fx" in warning


# --- studies -------------------------------------------------------------------------------------


def test_a_study_in_memory_has_the_numbers_of_one_of_the_workflow(tmp_path):
    scheme, given = tmp_path / "mine.yaml", ["fibonacci-9", str(tmp_path / "mine.yaml")]
    directions = (-get_scheme("fibonacci-12").directions).tolist()
    scheme.write_text(yaml.safe_dump({"scheme": "mine", "directions": directions}))
    result = acs.simulate(
        ["bias", "bias-scale"], given, ["gravity", "robot"], sigma=["3 mm/s^2", 0.001],
        robot_sigma="3.2 mgon", truth={"b_x": "50 mm/s^2", "s_y": 200 * 1e-6}, replicates=40,
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
    assert np.array_equal(result.estimates["estimate"], written["estimates"]["estimate"])


def test_a_simulation_is_a_result_with_the_tables_of_a_study(tmp_path):
    result = acs.simulate("bias", "faces-6", ["gravity", "robot"], sigma="2mm/s^2", replicates=20)
    result.save(tmp_path / "simulated")
    written = {path.stem: read_table(path) for path in (tmp_path / "simulated").glob("*.parquet")}
    assert set(written) == set(result.tables)
    pd.testing.assert_frame_equal(written["summary"], result.tables["summary"])
    said = json.loads((tmp_path / "simulated/simulation.json").read_text(encoding="utf-8"))
    assert (said["state"], said["verdict"]) == (result.state, result.verdict)
    result.save(tmp_path / "simulated")  # the same again takes no `force`
    # The tables of a study have the same names, and are no simulation to write over.
    (tmp_path / "simulated/simulation.json").unlink()
    with pytest.raises(acs.InputError, match="is not empty"):
        result.save(tmp_path / "simulated")
