"""Figures draw from the tables of a study, small or incomplete, and show the right numbers."""

from functools import cache

import numpy as np
import pandas as pd
import pytest
from docutils.core import publish_string
from study_helpers import NINE, content, grid, run_study

from accelstudy.drawing import style
from accelstudy.effects import effect_names
from accelstudy.sensors.models import MODELS
from accelstudy.study.config import Study, parse_study
from accelstudy.study.figures import caption, draw, figure_names, get_figure, write_figure
from accelstudy.study.figures.attitudes import sigma_table
from accelstudy.study.figures.calibrations import correlation_table, single_runs
from accelstudy.study.figures.factors import FACTORS
from accelstudy.study.figures.panels import tilt_errors
from accelstudy.study.sensitivity import sensitivity_table

PAPER = content(
    grids=[grid(schemes=["faces-6", "mclaren-24"], replicates=30), grid(f"{NINE}-crossaxis")],
    leveling={"attitudes": 10},
    sensitivity={
        **{"base_samples": 32},
        **{"roll_gon": [-50, 0, 50], "pitch_gon": [-25, 0, 25]},
    },
    paper=True,
)


@pytest.fixture(autouse=True)
def _few_pixels(monkeypatch):
    monkeypatch.setattr("accelstudy.drawing.style.DPI", 40)


@pytest.fixture(scope="module")
def paper() -> Study:
    return parse_study(PAPER)


@pytest.fixture(scope="module")
def tables(paper, tmp_path_factory) -> dict[str, pd.DataFrame]:
    found = run_study(tmp_path_factory.mktemp("paper"), **PAPER)
    sensitivity = sensitivity_table(paper, found["summary"])
    return {**found, "sensitivity": sensitivity}


@pytest.fixture(scope="module")
def figure_of(tables, paper):
    """Function that draws a figure of the study of the paper, each once."""
    return cache(lambda name: draw(name, tables, paper))


ALL = figure_names(parse_study(PAPER))
OTHERS = [*(f"sweep-{factor.name}" for factor in FACTORS)]


def test_a_paper_study_has_the_figures_of_the_paper_and_of_every_study():
    expected = [f"figure-{n}" for n in range(2, 9)] + ["leveling-overview"]
    assert {*expected} <= {*ALL}
    assert {*OTHERS}.isdisjoint(ALL)
    assert {*OTHERS} < {*figure_names()}


@pytest.mark.parametrize("name", ALL + tuple(OTHERS))
def test_every_figure_has_a_title_and_a_caption_that_a_report_can_show(name, paper):
    entry, text = get_figure(name), caption(name, paper)
    assert entry.title
    assert not set("{}.") & set(entry.title)
    assert len(text.split()) > 20
    assert "mgon = " in text
    publish_string(text, settings_overrides={"halt_level": 2})  # warnings are errors


@pytest.mark.parametrize(("kind", "head"), [("svg", b"<?xml"), ("png", b"\x89PNG")])
def test_a_figure_is_written_in_the_same_bytes_each_time(kind, head, tables, paper, tmp_path):
    paths = [tmp_path / f"{name}.{kind}" for name in ("first", "second")]
    for path in paths:
        write_figure("figure-3", tables, paper, path)
    one, other = (path.read_bytes() for path in paths)
    assert one == other
    assert one.startswith(head)


@pytest.mark.parametrize("name", ALL)
def test_labels_have_units_and_lie_within_the_figure(name, figure_of):
    drawn = figure_of(name)
    drawn.draw_without_rendering()
    labels = [part for ax in drawn.axes for part in (ax.title, ax.xaxis.label, ax.yaxis.label)]
    labels += [text for text in drawn.texts if text.get_text()]
    labels += [text for legend in drawn.legends for text in legend.get_texts()]
    box, written = drawn.bbox.padded(1), [label for label in labels if label.get_text()]
    for label in written:
        extent = label.get_window_extent()
        assert box.x0 <= extent.x0 < extent.x1 <= box.x1, label
        assert box.y0 <= extent.y0 < extent.y1 <= box.y1, label
    words = " ".join(label.get_text() for label in written)
    units = ("gon", "ppm", "mm/s²", "share", "sd", "correlation", "%")
    assert any(unit in words for unit in units)
    assert "m/s^2" not in words


@pytest.mark.parametrize("name", ALL)
def test_a_study_without_estimable_cells_draws(name, tables, paper):
    summary = tables["summary"].copy()
    numbers = summary.columns[summary.columns.str.startswith(("bias", "sd_", "coverage"))]
    summary[numbers] = np.nan
    nothing = {key: table.iloc[:0] for key, table in tables.items()}
    nothing["cells"] = tables["cells"].assign(estimable=False, n_converged=0)
    nothing["summary"] = summary.assign(estimable=False, n_converged=0)
    drawn = draw(name, {key: nothing[key] for key in get_figure(name).tables}, paper)
    drawn.draw_without_rendering()
    lines = [line for ax in drawn.axes for line in ax.get_lines()]
    crosses = sum(len(line.get_xdata()) for line in lines if line.get_marker() == "x")
    said = {text.get_text() for ax in drawn.axes for text in ax.texts}
    assert crosses or said & {"nothing to show", "no estimable cell"} or not get_figure(name).tables


def test_figures_2_and_3_show_the_closed_form(paper):
    table = sigma_table([0.0, 0.0], [0.0, 50.0], paper.noise.sensor.sigma_mps2, paper.gravity_mps2)
    sigma = table.set_index(["angle", "pitch"])["sigma"]
    np.testing.assert_allclose(sigma["roll"], [12.9836, 18.3616], atol=1e-3)
    np.testing.assert_allclose(sigma["pitch"], 12.9836, atol=1e-3)
    labels = [text.get_text() for text in draw("figure-3", {}, paper).axes[0].get_legend().texts]
    assert labels == ["roll: 18.36 mgon at 2 mm/s²", "pitch: 12.98 mgon at 2 mm/s²"]


def test_figure_4_shows_sobol_over_linear_theory_and_nothing_that_does_not_vary(tables, paper):
    table = tables["sensitivity"].copy()
    gone = (table["roll_gon"] == 0) & (table["output"] == "roll")
    table.loc[gone, ["total_effect", "ci95"]] = np.nan
    table.loc[gone, "defined"] = False
    drawn = draw("figure-4", {"sensitivity": table}, paper)
    theory, half, circles = drawn.axes[1].collections  # f_y on roll: cos² of roll
    assert set(circles.get_offsets().compressed().reshape(-1, 2)[:, 0]) == {-50, 50}
    np.testing.assert_allclose(circles.get_array().compressed(), 0.5, atol=0.2)  # of 32 samples
    np.testing.assert_allclose(np.abs(half.get_paths()[0].vertices[:, 0]), 50, atol=0.1)
    assert np.max(theory.get_array()) > 0.999
    draw("figure-5", {"sensitivity": table}, paper)


def test_the_tilt_overview_shows_rms_quantile_and_the_noise_of_a_reading(tables, figure_of):
    drawn, cell = figure_of("leveling-overview"), f"{NINE}/mclaren-24/gravity"
    row = tables["leveling"].set_index("cell").loc[cell]
    shown = tilt_errors(tables["cells"], tables["leveling"])
    shown = shown.set_index(["group", "cell"]).loc["roll", cell]
    assert (shown["value"], shown["both"]) == (row["roll_rms_mgon"], row["both_rms_q95_mgon"])
    written = {text.get_text() for text in drawn.axes[0].texts}
    assert f"{shown['value']:.1f}\n{shown['both']:.1f}" in written
    (crosses,) = drawn.axes[0].get_lines()
    assert len(crosses.get_xdata()) == tables["cells"]["estimable"].eq(False).sum()
    legend = " ".join(text.get_text() for text in drawn.legends[0].get_texts())
    assert "13.0 mgon" in legend
    assert "at tilts up to 50 gon" in drawn.axes[-1].get_ylabel()


def test_figure_7_has_the_first_simulation_the_middle_of_all_and_the_mean_sd(tables, paper):
    runs = single_runs(tables, paper).query("approach == 'gravity' and parameter == 'b_x'")
    errors, sds = (rows.iloc[0] for _, rows in runs.groupby("quantity"))
    of_cell = (
        table[table["cell"].astype(str) == f"{NINE}/mclaren-24/gravity"]
        for table in (tables["estimates"], tables["quantiles"], tables["summary"])
    )
    estimates, quantiles, summary = of_cell
    first = estimates.query("parameter == 'b_x' and replicate == 0").iloc[0]
    assert errors["first"] == pytest.approx(1e3 * (first["estimate"] - first["truth"]))
    found = quantiles.query("name == 'b_x' and quantity == 'error'")
    found = found[found["probability"].isin([0.025, 0.975])]["value"]
    np.testing.assert_allclose(errors[["low", "high"]].astype(float), found)
    mean = summary.set_index("parameter")["sd_posteriori_mean"]["b_x"]
    assert sds["mean"] == pytest.approx(mean)


def test_figure_8_has_no_diagonal(tables, paper):
    sizes = correlation_table(tables, paper).query("approach == 'gravity'")
    sizes = sizes.set_index(["parameter_1", "parameter_2"])["number"]
    assert len(sizes) == 9 * 9
    assert sizes["s_x", "s_y"] == pytest.approx(0.25, abs=0.01)  # in an isotropic scheme
    np.testing.assert_allclose([sizes[n, n] for n in ("b_x", "s_x")], 0, atol=1e-12)


def test_effects_of_the_models_causes_and_approaches_have_colours_of_their_own():
    modelled = {effect for effects in MODELS.values() for effect in effects}
    groups = [style.group_colour(name) for name in ("force", *modelled)]
    approaches = [style.approach_colour(name) for name in ("gravity", "robot")]
    causes = [*style.CAUSES.values()]
    assert len({*groups, *approaches, *causes}) == len(groups) + len(approaches) + len(causes)
    for name in set(effect_names()) - modelled:
        assert style.group_colour(name) == style.CAUSES[style.cause(name)]
    assert {style.cause(name) for name in set(effect_names()) - modelled} == set(style.CAUSES)
