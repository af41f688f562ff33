"""Cells of a study: what they are, and that nothing outside a cell changes its numbers."""

import itertools
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from study_helpers import NINE, grid, make_cells, make_study, run_study, simulated
from usual import PAPER_TRUTH

from accelstudy.approaches import approach_names
from accelstudy.basics.units import MGON
from accelstudy.sensors.models import MODELS
from accelstudy.simulation.sessions import BLOCK, Noise
from accelstudy.study.cell import fanned_out

GRAVITY, ROBOT = f"{NINE}/mclaren-24/gravity", f"{NINE}/mclaren-24/robot"


def estimates(cell, seed=1):
    return simulated(cell, seed).estimates


# --- what a cell is ------------------------------------------------------------------------------


def test_all_is_every_combination():
    cells = make_cells(
        grid(models="all", schemes=["faces-6", "rings-24"], approaches="all"),
        models={"mine": ["bias", "cubic_scale"]},
    )
    expected = itertools.product([*MODELS, "mine"], ["faces-6", "rings-24"], approach_names())
    assert [*cells] == ["/".join(names) for names in expected]


def test_noise_of_a_grid_is_in_the_name_and_in_the_cell():
    cells = make_cells(
        grid(
            approaches="robot", sensor_sigma_mps2=[0.002, 0.01], robot_sigma_mgon=[0, 3.2],
            gravity_sigma_mps2=1e-4, gravity_error_mps2=-3e-4,
        ),
    )  # fmt: skip
    rest = "gravity_sigma_mps2=0.0001/gravity_error_mps2=-0.0003"
    assert {name.removeprefix(f"{ROBOT}/"): cell.noise for name, cell in cells.items()} == {
        f"robot_sigma_mgon=0/{rest}": Noise(0.002, 0.0, 1e-4, -3e-4),
        rest: Noise(0.002, 3.2 * MGON, 1e-4, -3e-4),
        f"sensor_sigma_mps2=0.01/robot_sigma_mgon=0/{rest}": Noise(0.01, 0.0, 1e-4, -3e-4),
        f"sensor_sigma_mps2=0.01/{rest}": Noise(0.01, 3.2 * MGON, 1e-4, -3e-4),
    }
    close = make_cells(grid(approaches="gravity", sensor_sigma_mps2=[0.001, 0.0010000001]))
    assert [cell.noise.sigma_force for cell in close.values()] == [0.001, 0.0010000001]


def test_the_robot_does_not_concern_the_gravity_approach():
    usual = make_cells(grid())[GRAVITY]
    swept = make_cells(grid(robot_sigma_mgon=[0, 1, 50]))
    other = make_cells(grid(), noise={"robot": {"sigma_mgon": 9}})[GRAVITY]
    assert [name for name in swept if "gravity" in name.split("/")] == [GRAVITY]
    assert usual == swept[GRAVITY] == other
    assert usual.noise.sigma_angle == 0


def test_effects_of_the_simulated_sensor():
    cells = make_cells(
        grid(models=["bias-scale", NINE]), simulated_effects=["bias", "nonorthogonality"]
    )
    for cell in cells.values():
        assert cell.simulated_effects == ("bias", "nonorthogonality")
        assert cell.simulated_model.parameter_names[3:] == ("alpha_yz", "alpha_zy", "alpha_zx")
        assert {**PAPER_TRUTH, **cell.truth} == pytest.approx(PAPER_TRUTH)
    assert cells[GRAVITY].estimated_model.n_parameters == 9
    assert cells["bias-scale/mclaren-24/gravity"].estimated_model.n_parameters == 6


def test_a_repeated_cell_runs_once_with_the_larger_number():
    cells = make_cells(grid(replicates=20), grid(replicates=30), grid(replicates=10))
    assert [*cells] == [GRAVITY, ROBOT]
    assert {cell.replicates for cell in cells.values()} == {30}


def test_cells_fan_out_by_what_they_have_in_common():
    cells = [*make_cells(grid(["bias-scale", NINE], ["mclaren-24", "faces-6"])).values()]
    groups = fanned_out(cells, "{model}/{approach}")
    assert [*groups] == [f"{m}/{a}" for m in ("bias-scale", NINE) for a in ("gravity", "robot")]
    assert [cell.scheme for cell in groups[f"{NINE}/robot"]] == ["mclaren-24", "faces-6"]
    assert len(fanned_out(cells, "{model}/{scheme}/{approach}")) == len(cells)
    assert fanned_out([], "{model}") == {}


# --- seeds ---------------------------------------------------------------------------------------


def test_every_cell_and_block_has_its_own_seed():
    more = grid(sensor_sigma_mps2=[1e-3, 3e-3], robot_sigma_mgon=[0, 3.2])
    study = make_study(grids=[grid("all", "all", 1), more])
    cells = study.cells
    words = {tuple(cell.seed(1, block).generate_state(4)) for cell in cells for block in range(3)}
    assert len(words) == 3 * len(cells)
    assert not words & {tuple(cell.seed(2, 0).generate_state(4)) for cell in cells}


def test_more_replicates_extend_the_fewer():
    cell = make_cells(grid(replicates=BLOCK + 30))[ROBOT]
    many = estimates(cell)
    assert len(many) == len(np.unique(many[:, 0])) == BLOCK + 30
    assert not np.any(many == estimates(cell, 2))
    for fewer in (1, 20, BLOCK, BLOCK + 1):
        np.testing.assert_array_equal(estimates(replace(cell, replicates=fewer)), many[:fewer])


BASE = {"grids": [grid(["bias-scale", NINE], ["mclaren-24", "faces-6"], 60)]}
BIGGER = {
    "grids": [
        grid(NINE, ["rings-24", "faces-6", "mclaren-24"], 60, approaches=["robot", "gravity"]),
        grid(["bias-scale", NINE], "mclaren-24", 90, sensor_sigma_mps2=[0.001, 0.002]),
        grid("bias-scale", ["faces-6"], 700),
    ],
    "study": "other",
}


@pytest.fixture(scope="module")
def base(tmp_path_factory):
    return run_study(tmp_path_factory.mktemp("base"), **BASE)


def test_other_cells_and_another_order_change_no_number(base, tmp_path):
    """Bitwise: more cells, other grids, another order, more replicates, other jobs."""
    other = run_study(tmp_path, "{model}/{scheme}", **BIGGER)
    keys = ["cell", "replicate", "parameter"]
    small, large = (
        run["estimates"].astype({"cell": str, "parameter": str, "unit": str})
        for run in (base, other)
    )
    assert len(large) > 3 * len(small)
    found = large.merge(small[keys], on=keys).sort_values(keys, ignore_index=True)
    pd.testing.assert_frame_equal(
        found, small.sort_values(keys, ignore_index=True), check_exact=True
    )
