"""The Parquet files of a study: content, origin, and that none is left half-written."""

import json
import subprocess

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
import scipy
from study_helpers import NINE, PROVENANCE, grid, make_cells, run_study, simulate_cells, simulated
from usual import PAPER_TRUTH

import accelstudy
from accelstudy.basics.errors import InputError
from accelstudy.design.estimability import estimability
from accelstudy.files import tables
from accelstudy.files.tables import git_commit, read_origin, read_table, write_table
from accelstudy.study import tables as module
from accelstudy.study.replicates import ESTIMATES
from accelstudy.study.statistics import statistics
from accelstudy.study.tables import read_estimates

GRAVITY, ROBOT = f"{NINE}/mclaren-24/gravity", f"{NINE}/mclaren-24/robot"


# --- content -------------------------------------------------------------------------------------


def test_rows_of_the_estimates(tmp_path):
    cells = make_cells(grid(schemes=["faces-6", "mclaren-24"], approaches="gravity"), grid())
    estimates = simulate_cells(tmp_path, cells.values())["estimates"]
    assert pq.read_schema(estimates).equals(ESTIMATES)
    assert not read_table(estimates).drop(columns="omega").isna().any().any()
    table = read_estimates(estimates, GRAVITY)
    result = simulated(cells[GRAVITY])
    assert table["replicate"].tolist() == np.repeat(np.arange(60), 9).tolist()
    assert table["parameter"].tolist() == 60 * [*PAPER_TRUTH]
    np.testing.assert_array_equal(table["estimate"], result.estimates.ravel())
    np.testing.assert_array_equal(table["omega"], np.repeat(result.omega, 9))
    assert table["truth"].tolist() == pytest.approx(60 * [*PAPER_TRUTH.values()], rel=1e-14)
    units = table.groupby("parameter", observed=True)["unit"].first().astype(str)
    assert units.to_dict() == {
        **dict.fromkeys(("b_x", "b_y", "b_z"), "m/s^2"),
        **dict.fromkeys(("s_x", "s_y", "s_z"), "1"),
        **dict.fromkeys(("alpha_yz", "alpha_zy", "alpha_zx"), "rad"),
    }
    # Linear theory of the same noise stands beside them, and differs by next to nothing.
    robot = read_estimates(estimates, [ROBOT])
    apart = (robot["estimate"] - robot["linear_estimate"]).abs()
    assert (apart < 1e-3 * robot["sigma_priori"]).all()
    assert set(table["redundancy"]) == {15}
    np.testing.assert_allclose(
        table["sigma_posteriori"] ** 2, table["omega"] / 15 * table["sigma_priori"] ** 2, rtol=1e-14
    )
    assert set(robot["redundancy"]) == {63}
    assert len(read_estimates(estimates)) == 2 * len(table) == 2 * 60 * 9


def test_observed_gravity_is_a_parameter(tmp_path):
    cells = make_cells(grid(approaches="robot", gravity_sigma_mps2=1e-4))
    table = read_estimates(simulate_cells(tmp_path, cells.values())["estimates"])
    g = table[table["parameter"] == "g"]
    assert set(g["unit"]) == {"m/s^2"}
    assert set(g["truth"]) == {9.80665}
    # One observed value, which the positions can hardly improve: scales take up all of g.
    assert abs(g["error"].std() / 1e-4 - 1) < 4.5 / np.sqrt(2 * 59)


def test_calibrations_do_not_hang_on_how_many_are_made_together(tmp_path, monkeypatch):
    cells, made = make_cells(grid(replicates=1300)).values(), []
    for chunk in (10_000, 500):
        monkeypatch.setattr("accelstudy.study.replicates.CHUNK", chunk)
        paths = simulate_cells(tmp_path, cells)
        made.append({name: read_table(path) for name, path in paths.items()})
    for name, whole in made[0].items():
        pd.testing.assert_frame_equal(made[1][name], whole, rtol=1e-9)


# --- origin --------------------------------------------------------------------------------------


def test_origin_is_in_every_file(tmp_path):
    run_study(tmp_path, grids=[grid()])
    paths = sorted(tmp_path.rglob("*.parquet"))
    assert len(paths) == (1 + 5) + 5
    for path in paths:
        assert read_origin(path) == {
            **PROVENANCE, "version": accelstudy.__version__, "commit": git_commit(),
            "numpy": np.__version__, "scipy": scipy.__version__,
            "llvmlite": tables._version("llvmlite"),
        }  # fmt: skip
        assert json.loads(pq.read_schema(path).metadata[b"accelstudy"]) == read_origin(path)


def git(folder, *words):
    given = ("-c", "user.name=n", "-c", "user.email=e@example.org")
    ran = subprocess.run(["git", "-C", folder, *given, *words], capture_output=True, text=True)
    return ran.stdout.strip()


def test_a_repository_around_an_installed_package_is_not_its_own(tmp_path, monkeypatch):
    commit = git_commit.__wrapped__  # which asks each time
    installed = tmp_path / "env" / "tables.py"
    installed.parent.mkdir()
    installed.write_text("")
    beside = tmp_path / "beside.py"
    beside.write_text("")
    monkeypatch.setattr(tables, "__file__", str(installed))
    git(tmp_path, "init")
    git(tmp_path, "commit", "--allow-empty", "--message", "somebody's project")
    assert commit() == "unknown"
    git(tmp_path, "add", "--all")
    git(tmp_path, "commit", "--message", "a copy under git")
    assert commit() == (head := git(tmp_path, "rev-parse", "HEAD"))
    beside.write_text("an edit")
    assert commit() == f"{head}+"


# --- whole or not at all -------------------------------------------------------------------------


def test_nothing_is_left_of_an_interrupted_job(monkeypatch, tmp_path):
    calls = []

    def broken(cell, *which, **more):
        calls.append(cell.name)
        if len(calls) == 2:
            raise KeyboardInterrupt
        return statistics(cell, *which, **more)

    monkeypatch.setattr(module, "statistics", broken)
    with pytest.raises(KeyboardInterrupt):
        simulate_cells(tmp_path, make_cells(grid()).values())
    assert calls == [GRAVITY, ROBOT]
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == []


# --- reading -------------------------------------------------------------------------------------


def test_reading_files_and_folders(tmp_path):
    paths = [tmp_path / f"{name}.parquet" for name in "ab"]
    for i, path in enumerate(paths):
        write_table(path, pd.DataFrame({"x": [i, i + 10], "is": ["low", "high"]}), PROVENANCE)
    (tmp_path / ".accelstudy-1.part").mkdir()
    (tmp_path / ".accelstudy-1.part" / "c.parquet").write_bytes(b"half")
    assert read_table(paths[1])["x"].tolist() == [1, 11]
    assert read_table(paths)["x"].tolist() == read_table(tmp_path)["x"].tolist() == [0, 10, 1, 11]
    assert read_table(paths, columns=["x"]).columns.tolist() == ["x"]


def test_a_cell_in_two_files_of_a_folder_is_an_error(tmp_path):
    """As a study leaves them that fans out otherwise than before."""
    for name in ("model", "model/scheme"):
        path = tmp_path / name / "gravity.parquet"
        write_table(
            path, pd.DataFrame({"cell": ["a", "b"], "replicate": 0, "parameter": "b_x"}), PROVENANCE
        )
    with pytest.raises(InputError, match=r"two files hold the cell a; delete"):
        read_estimates(tmp_path)


def test_angles_that_tell_nothing_leave_what_gravity_tells():
    """The weights of sigmas that differ by 1e10 have enough digits."""
    keys = {"sensor_sigma_mps2": 1e-9, "robot_sigma_mgon": 4e5}
    cells = make_cells(grid(schemes="mclaren-24", approaches=["robot", "gravity"], **keys)).values()
    robot, gravity = (
        estimability(cell.positions, cell.estimated_model, cell.conditions, cell.noise).sigma
        for cell in cells
    )
    np.testing.assert_allclose(robot, gravity, rtol=1e-4)
