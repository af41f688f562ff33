"""Figures over what a study varies, for factorial configurations of any kind."""

import numpy as np
import pytest
from study_helpers import NINE, grid, make_study, run_study

from accelstudy.study.figures import caption, draw, figure_names
from accelstudy.study.figures.factors import FACTORS, swept
from accelstudy.study.figures.sweep import NONE, SOME, sweep_table

SENSOR, ROBOT, GRAVITY_SD, GRAVITY_ERROR, POSITIONS = FACTORS
FOUR = ["mclaren-24", "faces-edges-18", "fibonacci-30", "xsens-38"]
FACTORIAL = {"sensor_sigma_mps2": [0.001, 0.005], "robot_sigma_mgon": [1, 5, 20]}


def study_of(*grids, **keys):
    return make_study(grids=list(grids), leveling={"attitudes": 5}, **keys)


@pytest.fixture(scope="module")
def factorial(tmp_path_factory):
    """Four schemes and two factors, neither with the study's default value; and its tables."""
    keys = {"grids": [grid(schemes=FOUR, replicates=3, **FACTORIAL)]}
    keys["leveling"] = {"attitudes": 5}
    return make_study(**keys), run_study(tmp_path_factory.mktemp("factorial"), **keys)


def of_factors(study):
    """Figures that a study has or lacks by what it varies."""
    names = {"leveling-overview", *(f"sweep-{factor.name}" for factor in FACTORS)}
    return names & {*figure_names(study)}


def test_each_factor_of_a_study_has_a_figure():
    both = {"sweep-robot-noise", "sweep-sensor-noise"}
    assert of_factors(study_of(grid(**FACTORIAL))) == both
    sizes = study_of(grid(schemes=["fibonacci-12", "fibonacci-24"], sensor_sigma_mps2=0.005))
    assert of_factors(sizes) == {"leveling-overview", "sweep-positions"}
    assert of_factors(study_of(grid(schemes="all"))) == {"leveling-overview"}


def test_both_approaches_are_drawn_where_no_factor_has_its_default(factorial):
    study, tables = factorial
    table = sweep_table(tables, study, SENSOR)
    assert set(table["group"]) == {"bias", "scale", "nonorthogonality", "roll", "pitch"}
    lines = table.groupby(["group", "subject", "approach"])
    assert lines.ngroups == 5 * 4 * 2
    for _, line in lines:
        np.testing.assert_allclose(line["x"], [1, 5])
        assert np.isfinite(line["value"]).all()
    rows = tables["summary"]
    rows = rows[rows["cell"].str.startswith(f"{NINE}/xsens-38/robot/sensor_sigma_mps2=0.001/")]
    rows = rows[rows["cell"].str.endswith("=5") & rows["parameter"].str.startswith("b_")]
    at = table.query("group == 'bias' and subject == '38 Xsens log' and approach == 'robot'")
    assert at["value"].iloc[0] == pytest.approx(rows["sd_empirical"].mean(), rel=1e-12)


def test_the_unit_of_the_user_holds_where_the_study_names_none(monkeypatch):
    study = study_of(grid())
    monkeypatch.setenv("ACCELSTUDY_ANGLE_UNIT", "deg")
    assert "1 mdeg" in caption("leveling-overview", study)
    named = study.model_copy(update={"angle_unit": "gon"})
    assert "1 mgon" in caption("leveling-overview", named)


def test_what_failed_and_what_does_not_vary_is_marked(factorial):
    study, tables = factorial
    cells = tables["cells"].copy()
    at = cells["cell"].str.startswith(f"{NINE}/mclaren-24/robot/sensor_sigma_mps2=0.001/")
    one, two, three = cells.index[at]
    cells.loc[one, "estimable"] = False
    cells.loc[two, "n_converged"] = 0
    cells.loc[three, "n_converged"] = 1
    tables = {**tables, "cells": cells}
    table = sweep_table(tables, study, ROBOT).query("subject == '24 McLaren' and group == 'bias'")
    states = table[table["approach"] == "robot"].set_index("x")["state"]
    assert states.to_dict() == {1: NONE, 5: NONE, 20: SOME}
    by_gravity = table[table["approach"] == "gravity"]
    assert [*by_gravity["x"]] == [1, 20]
    assert by_gravity["value"].nunique() == 1
    drawn = draw("sweep-robot-noise", tables, study)
    lines = drawn.axes[0].get_lines()
    crosses = [np.isfinite(line.get_ydata()).sum() for line in lines if line.get_marker() == "x"]
    assert sum(crosses) == 2
    labels = [text.get_text() for text in drawn.legends[0].get_texts()]
    assert labels[-2:] == [SOME, NONE]
    assert [label for label in labels if label in table["subject"].unique()] == ["24 McLaren"]


def test_an_error_of_gravity_shows_a_significant_bias(tmp_path):
    keys = {"grids": [grid(gravity_error_mps2=[0, 0.01], approaches="robot")]}
    keys["leveling"] = {"attitudes": 5}
    table = sweep_table(run_study(tmp_path, **keys), make_study(**keys), GRAVITY_ERROR)
    biases = table.set_index(["group", "x"])["bias"].dropna()
    assert list(biases.index) == [("scale", 10)]
    assert biases.iloc[0] == pytest.approx(1e6 * 0.01 / 9.80665, rel=0.05)


SIZES = ["fibonacci-12", "fibonacci-24", "fibonacci-50"]
ERRORS = [-0.01, -0.001, 0.001, 0.01]


def robot_of(values):
    return [grid(sensor_sigma_mps2=[0.001, 0.005], robot_sigma_mgon=values)]


TWO_GRIDS = [
    grid(sensor_sigma_mps2=[0.001, 0.005], robot_sigma_mgon=10, approaches="robot"),
    grid(robot_sigma_mgon=[1, 3.2, 5], approaches="robot"),
]
"""What one grid varies is held at a value of that grid, not at one of another."""


@pytest.mark.parametrize(("grids", "factor", "held", "x"), [
    # The value nearest to the default, of those with most.
    (robot_of([1, 3.2, 5, 20]), SENSOR, ["robot noise 3.2 mgon (one of 4)"], [0.001, 0.005]),
    ([grid(schemes=SIZES, sensor_sigma_mps2=0.005, robot_sigma_mgon=10)], POSITIONS,
     ["sensor noise 5 mm/s²", "robot noise 10 mgon"], [12, 24, 50]),
    # An error of gravity alone needs no zero.
    ([grid(gravity_error_mps2=ERRORS)], GRAVITY_ERROR,
     ["sensor noise 2 mm/s²", "robot noise 3.2 mgon"], ERRORS),
    (TWO_GRIDS, SENSOR, ["robot noise 10 mgon (one of 4)"], [0.001, 0.005]),
    ([grid(gravity_error_mps2=[0, 0.01]), grid(gravity_sigma_mps2=[0.001, 0.01])], GRAVITY_SD,
     ["sensor noise 2 mm/s²", "robot noise 3.2 mgon", "error of gravity 0 mm/s² (one of 2)"],
     [0, 0.001, 0.01]),
])  # fmt: skip
def test_other_factors_are_held_at_a_value_that_is_stated(grids, factor, held, x):
    rows = swept(study_of(*grids), factor).dropna(subset="x")
    (said,) = set(rows["held"])
    assert (said.split("\n"), sorted(set(rows["x"]))) == (held, x)
