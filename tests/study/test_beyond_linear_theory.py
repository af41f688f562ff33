"""The figure of what simulation adds: numbers where there are any, limits elsewhere."""

import numpy as np
import pandas as pd
import pytest
from study_helpers import make_study

from accelstudy.study.figures import draw, figure_names
from accelstudy.study.figures.beyond_linear_theory import largest_of_groups

NAME = "beyond-linear-theory"


def numbers(tables, column):
    """Numbers of each quantity, as they are drawn from left to right."""
    table = largest_of_groups(tables)
    return [
        table[column][table["quantity"] == quantity].dropna().to_numpy()
        for quantity in ("bias", "excess", "noise")
    ]


def tables(**columns):
    """Tables of one set-up, simulated often: its biases and scales have an sd of 10."""
    names = ["b_x", "b_y", "b_z", "s_x", "s_y", "s_z"]
    labels = {"cell": "a", "model": "bias-scale", "approach": "gravity", "n_converged": 10**6}
    labels |= {"sensor_sigma_mps2": 0.002, "gravity_error_mps2": 0.0}
    numbers = {"bias": 0.0, "bias_se": 0.01, "sd_empirical": 10.0, "sd_se": 0.01, "sd_linear": 10.0}
    summary = pd.DataFrame({"parameter": names, **labels, **numbers, **columns})
    return {"summary": summary, "cells": pd.DataFrame({**labels, "control": "linear"}, index=[0])}


@pytest.mark.parametrize("empirical", [11.0, 9.0])
def test_what_differs_from_zero_is_a_number_and_the_rest_a_limit(empirical):
    sds = [10, 10, 10, 10, empirical, 10.001]
    made = tables(bias=[0, -1, 0.5, 0, 0, 0], sd_empirical=sds)
    (bias,), (excess,), (noise,) = numbers(made, "size")
    size = abs((empirical / 10) ** 2 - 1)
    assert bias == pytest.approx(0.1)  # of the biases, the largest
    assert excess == pytest.approx(size)  # of the scales
    assert noise == pytest.approx(2 * np.sqrt(0.01 / size))  # mm/s²
    # Six numbers a panel share the 5 %: 2.638 standard errors on either side.
    (_, at_most), (limit, _), (least, _) = numbers(made, "limit")
    assert at_most == pytest.approx(0.02638 / min(empirical, 10), rel=1e-3)
    assert limit == pytest.approx(2.638 * 2e-3, rel=1e-3)
    assert least == pytest.approx(2 * np.sqrt(0.01 / limit))
    axes = draw(NAME, made, make_study()).axes
    assert [ax.get_xlabel() for ax in axes] == [
        *("|bias| / sd", "|variance / linear theory − 1|", "sensor noise for 1 % / mm/s²")
    ]
    marks = [line.get_marker() for line in axes[2].get_lines() if len(line.get_xdata()) == 1]
    assert marks == ["o", ">"]


def test_it_is_drawn_where_linear_theory_knows_what_is_simulated():
    assert NAME in figure_names(make_study())
    without = [
        {"noise": {"effects": ["heavy_tails(nu=3)"]}},
        {"simulated_effects": ["bias", "scale"]},
    ]
    for keys in without:
        assert NAME not in figure_names(make_study(**keys))
