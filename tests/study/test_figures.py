"""Figures draw from the tables of a study, small or incomplete, and show the right numbers."""

import subprocess
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from docutils.core import publish_string
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from study_helpers import run_study

from accelstudy.basics.errors import InputError
from accelstudy.drawing import style
from accelstudy.effects import effect_names
from accelstudy.sensors.models import MODELS, PRESETS, get_model
from accelstudy.study.config import Study, parse_study
from accelstudy.study.figures import (
    captions,
    draw,
    figure_names,
    figure_tables,
    get_figure,
    register,
    total_effects,
    write_figure,
)
from accelstudy.study.figures.calibrations import correlation_matrix, single_runs
from accelstudy.study.figures.factors import FACTORS
from accelstudy.study.figures.panels import Panel, panels
from accelstudy.study.figures.table_1 import preset_table
from accelstudy.study.sensitivity import sensitivity_table, shapley_table

PROVENANCE = {"config_hash": "test", "seed": 1}
NINE = "bias-scale-nonorthogonality"
SENSOR = {
    "bias": {"value": [0.05, 0.01, 0.03], "unit": "m/s^2"},
    "scale": {"value": [200, 200, 200], "unit": "ppm"},
    "nonorthogonality": {"value": [12, 12, 44], "unit": "mgon"},
}
PAPER = {
    "study": "tiny",
    "seed": 1,
    "sensor": SENSOR,
    "grids": [{"models": NINE, "schemes": ["faces-6", "mclaren-24"], "replicates": 30},
              {"models": f"{NINE}-crossaxis", "schemes": "mclaren-24", "replicates": 10}],
    "presets": {"replicates": 5},
    "leveling": {"attitudes": 10},
    "sensitivity": {"base_samples": 32,
                    "resamples": 10,
                    "roll_gon": [-50, 0, 50],
                    "pitch_gon": [-25, 0, 25]},
    "paper": True,
}  # fmt: skip


def run(keys: dict, folder: Path) -> dict[str, pd.DataFrame]:
    """All tables of a study."""
    study, tables = parse_study(keys), run_study(folder, **keys)
    if study.sensitivity:
        tables["sensitivity"] = sensitivity_table(study, tables["summary"])
        tables["shapley"] = shapley_table(study, tables["summary"], tables["correlations"])
    return tables


@pytest.fixture(autouse=True)
def _few_pixels(monkeypatch):
    monkeypatch.setattr("accelstudy.drawing.style.DPI", 40)


@pytest.fixture(scope="module")
def paper() -> Study:
    return parse_study(PAPER)


@pytest.fixture(scope="module")
def tables(tmp_path_factory) -> dict[str, pd.DataFrame]:
    return run(PAPER, tmp_path_factory.mktemp("paper"))


def paint(drawn: Figure) -> None:
    """Draw everything, without the time that a good layout takes."""
    drawn.set_layout_engine("none")
    drawn.draw_without_rendering()


def texts(drawn: Figure) -> list[str]:
    """All axis labels, also those that panels have in common."""
    own = [text for ax in drawn.axes for text in (ax.get_xlabel(), ax.get_ylabel())]
    return [text for text in (*own, drawn.get_supxlabel(), drawn.get_suptitle()) if text]


@pytest.fixture(scope="module")
def figure_of(tables, paper):
    """Function that draws a figure of the study of the paper, each once."""
    return cache(lambda name: draw(name, tables, paper))


ALL = figure_names(parse_study(PAPER))
OTHERS = [*(f"sweep-{factor.name}" for factor in FACTORS)]


def test_a_paper_study_has_the_figures_of_the_paper_and_of_every_study():
    expected = [f"figure-{n}" for n in range(2, 9)] + ["figure-5-robot", "figure-6-robot"]
    expected += ["closed-forms", "leveling-overview", "shapley", "table-1"]
    assert {*expected} <= {*ALL}
    assert {*OTHERS}.isdisjoint(ALL)


def test_every_figure_has_a_title_and_a_caption_that_a_report_can_show(paper):
    assert {*figure_names()} >= {*ALL, *OTHERS}
    for name, caption in captions(ALL, paper).items():
        entry = get_figure(name)
        assert entry.title
        assert entry.category
        assert len(caption.split()) > 20
        assert caption.startswith(entry.caption)
        assert ("mgon = " in caption) == entry.angles
        publish_string(caption, settings_overrides={"halt_level": 2})  # warnings are errors


def test_a_figure_of_a_table_that_there_is_not_is_refused():
    with pytest.raises(ValueError, match="figure 'mine': no such tables: summaries"):
        register("mine", tables=("summary", "summaries"))


def test_a_figure_is_written_with_its_caption_in_the_same_bytes_each_time(tables, paper, tmp_path):
    name = "closed-forms"
    for folder in (tmp_path / "first", tmp_path / "second"):
        write_figure(name, tables, paper, folder)
    written = {path.name: path.read_bytes() for path in (tmp_path / "first").iterdir()}
    assert sorted(written) == [f"{name}.{kind}" for kind in ("png", "rst", "svg")]
    for path in (tmp_path / "second").iterdir():
        assert path.read_bytes() == written[path.name]
    assert written[f"{name}.rst"].decode() == captions([name], paper)[name] + "\n"


@pytest.mark.parametrize("name", sorted(set(ALL) - {"figure-8", "closed-forms"}))
def test_labels_have_units(name, figure_of):
    quantities = texts(figure_of(name))
    assert any(
        unit in text for text in quantities for unit in ("mgon", " gon", "ppm", "mm/s²", "share")
    )
    assert not any("m/s^2" in text for text in quantities)


def test_figure_2_shows_the_closed_form(paper):
    roll, pitch = (ax.collections[0] for ax in draw("figure-2", {}, paper).axes[:2])
    mesh = roll.get_coordinates()
    level = np.abs(mesh[..., 1]) < 1e-9
    tilted = np.abs(np.abs(mesh[..., 1]) - 50) < 1e-9
    sigma = np.reshape(roll.get_array(), mesh.shape[:2])
    assert level.any()
    assert tilted.any()
    np.testing.assert_allclose(sigma[level], 12.9836, atol=1e-3)
    np.testing.assert_allclose(sigma[tilted], 18.3616, atol=1e-3)
    np.testing.assert_allclose(pitch.get_array(), 12.9836, atol=1e-3)


def test_figure_3_marks_the_closed_form(paper):
    lines = draw("figure-3", {}, paper).axes[0].get_lines()
    marks = {round(float(line.get_ydata()[0]), 2) for line in lines if len(line.get_xdata()) == 1}
    assert marks == {12.98, 18.36}


def test_figure_4_shows_sobol_over_linear_theory_and_marks_what_does_not_vary(tables, paper):
    table = tables["sensitivity"].copy()
    gone = (table["roll_gon"] == 0) & (table["output"] == "roll")
    table.loc[gone, ["total_effect", "ci95"]] = np.nan
    table.loc[gone, "defined"] = False
    drawn = draw("figure-4", {"sensitivity": table}, paper)
    ax = drawn.axes[1]  # f_y on roll: cos² of roll
    theory, half, circles = ax.collections
    assert set(circles.get_offsets()[:, 0]) == {-50, 50}
    np.testing.assert_allclose(circles.get_array(), 0.5, atol=0.2)  # of 32 samples
    assert set(ax.get_lines()[-1].get_xdata()) == {0}
    np.testing.assert_allclose(np.abs(half.get_paths()[0].vertices[:, 0]), 50, atol=0.1)
    assert np.max(theory.get_array()) > 0.999
    draw("figure-5", {"sensitivity": table}, paper)


def test_total_effects_are_labelled_and_their_lines_go_through_zero(tables, figure_of):
    drawn = figure_of("figure-5")
    labels = {text.get_text(): text.get_color() for ax in drawn.axes for text in ax.texts}
    assert {"$f_y$", "$f_z$", r"$\alpha_{zx}$", "$b_y$"} <= labels.keys()
    assert labels["$b_y$"] == style.group_colour("bias")
    rows = tables["sensitivity"].query("analysis == 'gravity' and output == 'roll'")
    small = rows.groupby("input")["total_effect"].max().loc[lambda share: share < 0.005].index
    title = drawn.get_suptitle()
    assert "below 1 % everywhere" in title
    assert all(style.symbol(name) in title for name in small)
    assert not {style.symbol(name) for name in small} & labels.keys()
    lines = [line for line in drawn.axes[0].get_lines() if line.get_marker() in ("", "None")]
    assert lines
    assert all(np.isfinite(line.get_ydata()).all() for line in lines)


@pytest.mark.parametrize("name", ["figure-5", "figure-6", "figure-6-robot", "shapley"])
def test_a_panel_has_the_lines_of_one_group_each_with_its_symbol(name, figure_of):
    for ax in figure_of(name).axes:
        lines = {line.get_color() for line in ax.get_lines() if line.get_linestyle() == "-"}
        symbols = [text.get_text() for text in ax.texts]
        assert len(lines - {style.INK}) <= 1
        assert len(symbols) == len(set(symbols)) <= 3


def test_symbols_of_lines_stand_apart():
    ax = style.new_figure(style.COLUMN, 40).subplots()
    ax.set_ylim(-1, 1)
    x = np.linspace(-90, 90, 7)
    names = ("f_x", "f_y", "f_z", "b_x", "b_y", "b_z")
    ends = (0.4, 0.4, 0.41, -0.3, -0.3, -0.6)
    total_effects.label_lines(
        ax, {n: (x, np.full(7, end)) for n, end in zip(names, ends, strict=True)}
    )
    heights = {text.get_text(): text.get_position()[1] for text in ax.texts}
    assert len(heights) == 6
    assert np.diff(sorted(heights.values())).min() > 0.99 * total_effects.HIGH
    for name, end in zip(names, ends, strict=True):
        height = 2 * heights[style.symbol(name)] - 1
        assert height > end if end > 0 else height < end


def test_shapley_effects_name_what_overtakes(tables, paper):
    table = tables["shapley"].assign(shapley_effect=tables["shapley"]["total_effect"])
    (ax,) = draw("shapley", {"shapley": table}, paper).axes
    assert [text.get_text() for text in ax.texts] == ["no share changes by 0.5 points"]

    at = table["output"].eq("roll") & table["roll_gon"].eq(50) & table["pitch_gon"].eq(25)
    table.loc[at & table["input"].eq("s_y"), "shapley_effect"] = 0.9
    level, tilted = draw("shapley", {"shapley": table}, paper).axes
    assert (level.get_title(), tilted.get_title()) == (r"$\theta$ = 0 gon", r"$\theta$ = 25 gon")
    assert level.get_ylabel() == "scale\non roll"
    rings = [
        (line.get_xdata()[0], line.get_ydata()[0])
        for ax in (level, tilted)
        for line in ax.get_lines()
        if line.get_markerfacecolor() == "none"
    ]
    gained = 90 - 100 * float(table.loc[at & table["input"].eq("s_y"), "total_effect"].iloc[0])
    assert rings == [(50, pytest.approx(gained))]


def test_table_1_has_the_mean_sd_of_a_group_and_the_tilt_error(tables, figure_of):
    cell = f"{NINE}/fibonacci-36/robot"
    place = [(p.model, p.scheme) for p in PRESETS].index((NINE, "fibonacci-36"))
    rows = preset_table(tables, ["gravity", "robot"])
    rows = rows[(rows["place"] == place) & (rows["approach"] == "robot")]
    value = rows.set_index("group")["value"]
    summary = tables["summary"][tables["summary"]["cell"] == cell]
    biases = summary[summary["parameter"].str.startswith("b_")]
    assert value["bias"] == pytest.approx(biases["sd_empirical"].mean())
    tilt = tables["leveling"].set_index("cell")["roll_rms_mgon"][cell]
    assert value["tilt"] == pytest.approx(tilt)
    written = {text.get_text() for ax in figure_of("table-1").axes for text in ax.texts}
    assert f"{tilt:.1f}" in written


def test_the_tilt_overview_shows_rms_quantile_and_the_noise_of_a_reading(tables, figure_of):
    drawn = figure_of("leveling-overview")
    row = tables["leveling"].set_index("cell").loc[f"{NINE}/mclaren-24/gravity"]
    written = {text.get_text() for text in drawn.axes[0].texts}
    assert {f"{row['roll_rms_mgon']:.1f}", f"{row['both_rms_q95_mgon']:.1f}"} <= written
    legend = " ".join(text.get_text() for text in drawn.legends[0].get_texts())
    assert "95 % of the calibrations" in legend
    assert "13.0 mgon" in legend
    assert "at tilts up to 50 gon" in drawn.axes[-1].get_ylabel()


def test_figure_7_has_the_first_simulation_the_middle_of_all_and_the_mean_sd(
    tables, paper, figure_of
):
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
    axes = figure_of("figure-7").axes
    assert sds["mean"] == pytest.approx(axes[1].patches[0].get_height())


def test_figure_8_has_no_diagonal(tables):
    names = get_model(NINE).parameter_names
    matrix = correlation_matrix(tables["correlations"], f"{NINE}/mclaren-24/gravity", list(names))
    assert matrix.shape == (9, 9)
    np.testing.assert_allclose(np.diag(matrix), 0, atol=1e-12)
    assert matrix[3, 4] == pytest.approx(0.25, abs=0.01)  # of the scales, in an isotropic scheme


def test_what_cannot_be_estimated_is_marked(figure_of):
    overview = figure_of("leveling-overview")
    assert sum(len(ax.patches) for ax in overview.axes[:4]) > 0
    crosses = [
        y
        for ax in figure_of("table-1").axes
        for line in ax.get_lines()
        if line.get_marker() == "x"
        for y in line.get_ydata()
    ]
    assert len(crosses) == 3 * 5  # three rows with the cross-axis angles, by gravity


@pytest.mark.parametrize("name", ALL)
def test_a_study_without_estimable_cells_draws(name, tables, paper):
    cells, summary = tables["cells"].copy(), tables["summary"].copy()
    cells["estimable"] = summary["estimable"] = False
    numbers = summary.columns[summary.columns.str.startswith(("bias", "sd_", "coverage"))]
    summary[numbers] = np.nan
    summary["n_converged"] = 0
    nothing = {
        "cells": cells, "summary": summary, "leveling": pd.DataFrame(),
        "correlations": pd.DataFrame(), "quantiles": tables["quantiles"].iloc[:0],
        "sensitivity": tables["sensitivity"].iloc[:0], "shapley": tables["shapley"].iloc[:0],
    }  # fmt: skip
    needed = {key: nothing[key] for key in figure_tables(name)}
    paint(draw(name, needed, paper))


@pytest.mark.parametrize("shared", [{}, {"sharex": True, "sharey": True}])
def test_an_empty_panel_has_neither_ticks_nor_numbers_of_its_own(shared):
    full, empty = Panel([1.0, 2.0]), Panel([])

    def shown(grid):
        drawn, axes = panels(grid, lambda ax, data: ax.plot(data), 40, **shared)
        paint(drawn)
        ticks = [tick for axis in (axes[0, 0].xaxis, axes[0, 0].yaxis) for tick in axis.majorTicks]
        length = {tick.tick1line.get_markersize() for tick in ticks}
        return length, {tick.label1.get_visible() for tick in ticks}

    assert shown([[empty, empty]]) == ({0.0}, {False})
    # The numbers of an axis in common stand at the left and at the bottom, whatever is there.
    assert shown([[empty], [full]])[0] == {0.0}
    assert shown([[empty, full]])[1] == {bool(shared)}
    assert shown([[full, empty]])[1] == {True}


def test_effects_of_the_models_causes_and_approaches_have_colours_of_their_own():
    modelled = {effect for effects in MODELS.values() for effect in effects}
    groups = [style.group_colour(name) for name in ("force", *modelled)]
    approaches = [style.approach_colour(name) for name in ("gravity", "robot")]
    causes = [*style.CAUSES.values()]
    assert len({*groups, *approaches, *causes}) == len(groups) + len(approaches) + len(causes)
    for name in set(effect_names()) - modelled:
        assert style.group_colour(name) == style.CAUSES[style.cause(name)]
    assert {style.cause(name) for name in set(effect_names()) - modelled} == set(style.CAUSES)


# Machado, Oliveira & Fernandes (2009), linear RGB, severity 1.
EYES = {
    "normal": np.eye(3),
    "protanopia": [[0.152286, 1.052583, -0.204868],
                   [0.114503, 0.786281, 0.099216],
                   [-0.003882, -0.048116, 1.051998]],
    "deuteranopia": [[0.367322, 0.860646, -0.227968],
                     [0.280085, 0.672501, 0.047413],
                     [-0.011820, 0.042940, 0.968881]],
}  # fmt: skip


def seen(colour, eye):
    """Colour as CIE L*a*b* to an eye (D65)."""
    rgb = np.array(to_rgb(colour))
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    to_xyz = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
    x, y, z = np.cbrt(to_xyz @ np.clip(np.array(EYES[eye]) @ linear, 1e-3, 1) / [0.95, 1, 1.09])
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


@pytest.mark.parametrize("eye", EYES)
def test_colours_of_causes_keep_apart(eye):
    """A difference of 2 can be seen side by side; far apart in a figure it takes some more."""
    others = [colour for _, colour in style.GROUPS.values()]
    others += [*style.APPROACH_COLOURS.values(), *style.CAUSES.values()]
    for colour in style.CAUSES.values():
        distances = [np.linalg.norm(seen(colour, eye) - seen(o, eye)) for o in others]
        assert sorted(distances)[1] > 15, colour


@pytest.mark.parametrize("cmap", ["viridis", "cividis", "Blues", "RdBu_r"])
def test_numbers_on_a_map_can_be_read(cmap):
    """The threshold of WCAG 2.2 for text, 4.5, is just missed by an ink that is not black."""
    ax = style.new_figure(1, 20).subplots()
    image = ax.imshow([[0, 1]], cmap=cmap)
    for value in np.linspace(0, 1, 101):
        (one, other) = sorted(
            brightness(colour) for colour in (style.ink_on(image, value), image.to_rgba(value))
        )
        assert (other + 0.05) / (one + 0.05) > 3.9


def brightness(colour):
    """Relative luminance, from CIE L*."""
    return ((seen(colour, "normal")[0] + 16) / 116) ** 3


def test_parameters_of_one_colour_differ_in_line_and_marker():
    names = ["b_x", "b_y", "b_z", "k_xy", "k_xz", "k_yx", "k_yz", "k_zx", "k_zy"]
    names += ["k_abs_x", "k_abs_y", "k_abs_z"]
    styles = [tuple(s.values()) for s in total_effects.styles_of(names).values()]
    assert len(set(styles)) == len(names)


def test_colours_are_the_same_in_every_figure(figure_of):
    robot = style.approach_colour("robot")
    for name in ("figure-7", "table-1", "closed-forms"):
        lines = figure_of(name).findobj(lambda artist: hasattr(artist, "get_marker"))
        assert robot in {line.get_color() for line in lines}
    colours = {ax.get_ylabel(): ax.yaxis.label.get_color() for ax in figure_of("figure-5").axes}
    for group in ("force", "bias", "scale"):
        assert colours[group] == style.group_colour(group)


@pytest.mark.parametrize(("model", "title"), [
    ("bias-scale-nonorthogonality", "9: + non-orthogonality"),
    ("bias-scale-nonorthogonality-thermal_bias", "9 + thermal bias"),
    ("bias-scale-base_tilt-hysteresis", "6 + base tilt + hysteresis"),
    ("mine", "mine"),
])  # fmt: skip
def test_titles_of_models_are_short(model, title):
    assert style.model_title(model) == title


def test_an_unknown_figure_is_an_input_error_that_names_a_near_one():
    with pytest.raises(InputError, match="figure-2"):
        get_figure("figure-22")


def test_a_figure_that_cannot_be_drawn_is_named(tables, paper, tmp_path):
    damaged = {**tables, "quantiles": tables["quantiles"].iloc[:, :3]}
    with pytest.raises(KeyError) as error:
        write_figure("figure-7", damaged, paper, tmp_path)
    assert error.value.__notes__ == ["The figure 'figure-7' could not be drawn."]
    assert not any(tmp_path.iterdir())


IMPORTED = """\
import sys
import accelstudy.study.figures, accelstudy.study.config
import accelstudy.jobs
print([name for name in ("matplotlib", "pandas", "scipy.stats") if name in sys.modules])
"""


def test_the_start_of_the_workflow_loads_nothing_that_draws():
    ran = subprocess.run(
        [sys.executable, "-c", IMPORTED], capture_output=True, text=True, check=True
    )
    assert ran.stdout.strip() == "[]"
