"""Figures over what a study varies, for factorial configurations of any kind."""

from itertools import pairwise

import numpy as np
import pytest
from study_helpers import NINE, grid, make_study, run_study

from accelstudy.basics.errors import InputError
from accelstudy.study.figures import angle_unit, captions, draw, figure_names
from accelstudy.study.figures.factors import FACTORS, blocks
from accelstudy.study.figures.sweep import block_table

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


def panels(drawn):
    return {ax.get_title(): ax for ax in drawn.findobj(lambda a: hasattr(a, "get_xlabel"))}


def lines(ax):
    """Colour -> lines with more than one point."""
    found = {}
    for line in ax.get_lines():
        if len(line.get_xdata()) > 1:
            found.setdefault(line.get_color(), []).append(line)
    return found


def titles(drawn):
    return [part.get_suptitle() for part in drawn.subfigs]


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
    (block,) = blocks(study, SENSOR)
    table = block_table(block, tables, SENSOR)
    assert set(table["group"]) == {"bias", "scale", "nonorthogonality", "roll", "pitch"}
    series = table.groupby(["group", "series", "approach"])
    assert series.ngroups == 5 * 4 * 2
    for _, line in series:
        np.testing.assert_allclose(line["x"], [1, 5])
        assert np.isfinite(line["value"]).all()
    rows = tables["summary"]
    rows = rows[rows["cell"].str.startswith(f"{NINE}/xsens-38/robot/sensor_sigma_mps2=0.001/")]
    rows = rows[rows["cell"].str.endswith("=5") & rows["parameter"].str.startswith("b_")]
    (at,) = table.query("group == 'bias' and series == 3 and approach == 'robot' and x == 1")[
        "value"
    ]
    assert at == pytest.approx(rows["sd_empirical"].mean(), rel=1e-12)
    robot = lines(panels(draw("sweep-sensor-noise", tables, study))["bias"])["#C2247A"]
    assert robot[3].get_ydata()[0] == at


def test_the_values_of_the_other_factors_are_stated(factorial):
    study, tables = factorial
    (title,) = titles(draw("sweep-sensor-noise", tables, study))
    assert "robot noise 5 mgon (of 1, 5, 20)" in title
    assert "9: + non-orthogonality" in title
    (title,) = titles(draw("sweep-robot-noise", tables, study))
    assert "sensor noise 1 mm/s² (of 1, 5), sd of gravity 0, error of gravity 0" in title
    text = captions(["sweep-sensor-noise"], study)["sweep-sensor-noise"]
    assert "Over the sensor noise, held fixed: robot noise 5 mgon" in text
    assert text.count("100 gon = 90°") == 1


def test_the_legend_of_four_schemes_lies_within_the_figure(factorial):
    study, tables = factorial
    drawn = draw("sweep-robot-noise", tables, study)
    drawn.draw_without_rendering()
    (legend,) = drawn.subfigs[0].legends
    box, page = legend.get_window_extent(), drawn.bbox
    assert page.x0 <= box.x0 < box.x1 <= page.x1
    assert page.y0 <= box.y0 < box.y1 <= page.y1


def test_angles_are_shown_in_degrees_where_the_study_says_so(factorial):
    study, tables = factorial
    gon, deg = (
        draw("sweep-robot-noise", tables, study.model_copy(update={"angle_unit": unit}))
        for unit in ("gon", "deg")
    )
    for name, ratio in (("tilt error, pitch", 0.9), ("bias", 1)):
        one, other = (panels(drawn)[name] for drawn in (gon, deg))
        pairs = zip(lines(one)["#C2247A"], lines(other)["#C2247A"], strict=True)
        for before, after in pairs:
            np.testing.assert_allclose(after.get_xdata(), 0.9 * before.get_xdata())
            np.testing.assert_allclose(after.get_ydata(), ratio * before.get_ydata())
    assert panels(deg)["tilt error, pitch"].get_ylabel() == "rms / mdeg"


def test_the_unit_of_the_user_holds_where_the_study_names_none(monkeypatch):
    study = study_of(grid())
    monkeypatch.setenv("ACCELSTUDY_ANGLE_UNIT", "deg")
    assert "1 mdeg" in captions(["leveling-overview"], study)["leveling-overview"]
    named = study.model_copy(update={"angle_unit": "gon"})
    assert "1 mgon" in captions(["leveling-overview"], named)["leveling-overview"]
    assert named.fingerprint == study.fingerprint
    monkeypatch.setenv("ACCELSTUDY_ANGLE_UNIT", "grad")
    with pytest.raises(InputError, match=r"ACCELSTUDY_ANGLE_UNIT: 'grad' .* gon or deg"):
        angle_unit(study)


def test_what_failed_is_marked(factorial):
    study, tables = factorial
    cells = tables["cells"].copy()
    at = cells["cell"].str.startswith(f"{NINE}/mclaren-24/robot/sensor_sigma_mps2=0.001/")
    one, two, three = cells.index[at]
    cells.loc[one, "estimable"] = False
    cells.loc[two, "n_converged"] = 0
    cells.loc[three, "n_converged"] = 1
    drawn = draw("sweep-robot-noise", {**tables, "cells": cells}, study)
    for ax in (panels(drawn)[name] for name in ("bias", "tilt error, pitch")):
        marks = {line.get_marker(): line.get_xdata() for line in ax.get_lines()}
        assert [marks["x"], marks["+"]] == [[1], [5]]
        hollow = [line for line in ax.get_lines() if line.get_markerfacecolor() == "white"]
        assert [x for line in hollow for x in line.get_xdata()] == [20]
    labels = [text.get_text() for text in drawn.subfigs[0].legends[0].get_texts()]
    assert labels[-3:] == ["not estimable", "none converged", "some did not converge"]


def test_many_schemes_are_drawn_a_few_at_a_time_on_the_same_axes(factorial, monkeypatch):
    study, tables = factorial
    monkeypatch.setattr("accelstudy.study.figures.sweep.IN_A_BLOCK", 2)
    drawn = draw("sweep-sensor-noise", tables, study)
    names = [[text.get_text() for text in part.legends[0].get_texts()] for part in drawn.subfigs]
    assert names == [
        ["gravity", "robot", "24 McLaren", "18 faces + edges"],
        ["gravity", "robot", "30 Fibonacci", "38 Xsens log"],
    ]
    axes = drawn.findobj(lambda artist: hasattr(artist, "get_xlabel"))
    roll = [ax for ax in axes if ax.get_title() == "tilt error, roll"]
    assert len(roll) == 2
    assert all(one.get_ylim() == other.get_ylim() for one, other in pairwise(roll))


def found(study, factor):
    """Levels and x values of each block."""
    return [
        (
            {column: level.value for column, level in block.levels.items()},
            sorted(set(block.cells["x"].dropna())),
        )
        for block in blocks(study, factor)
    ]


def test_the_default_is_held_where_it_was_run_and_the_middle_value_otherwise():
    def robot_of(values):
        study = study_of(grid(sensor_sigma_mps2=[0.001, 0.005], robot_sigma_mgon=values))
        return found(study, SENSOR)[0][0]["robot_sigma_mgon"]

    assert robot_of([1, 3.2, 5, 20]) == 3.2
    assert robot_of([1, 5, 20]) == 5
    assert robot_of([1, 5, 20, 50]) == 5
    assert robot_of(20) == 20


def test_single_values_other_than_the_default_are_held_and_stated():
    sizes = ["fibonacci-12", "fibonacci-24", "fibonacci-50"]
    study = study_of(grid(schemes=sizes, sensor_sigma_mps2=0.005, robot_sigma_mgon=10))
    ((levels, x),) = found(study, POSITIONS)
    assert x == [12, 24, 50]
    assert levels["sensor_sigma_mps2"] == 0.005
    assert levels["robot_sigma_mgon"] == 10


def test_an_error_of_gravity_alone_needs_no_zero():
    study = study_of(grid(gravity_error_mps2=[-0.01, -0.001, 0.001, 0.01]))
    ((levels, x),) = found(study, GRAVITY_ERROR)
    assert x == [-0.01, -0.001, 0.001, 0.01]
    assert levels["gravity_sigma_mps2"] == 0
    assert not any(found(study, factor) for factor in FACTORS if factor is not GRAVITY_ERROR)


def test_each_grid_keeps_the_values_over_which_it_varies():
    """What one grid varies is held at a value of that grid, not at one of another."""
    study = study_of(
        grid(sensor_sigma_mps2=[0.001, 0.005], robot_sigma_mgon=10, approaches="robot"),
        grid(robot_sigma_mgon=[1, 3.2, 5], approaches="robot"),
    )
    ((levels, x),) = found(study, SENSOR)
    assert (levels["robot_sigma_mgon"], x) == (10, [0.001, 0.005])
    ((levels, x),) = found(study, ROBOT)
    assert (levels["sensor_sigma_mps2"], x) == (0.002, [1, 3.2, 5])
    study = study_of(grid(gravity_error_mps2=[0, 0.01]), grid(gravity_sigma_mps2=[0.001, 0.01]))
    assert found(study, GRAVITY_SD)[0][1] == [0, 0.001, 0.01]
