"""The explorer shows what the tables hold; in a browser, what a person chooses of it."""

import base64
import gzip
import json
import re
import shutil
from urllib.parse import unquote, urlsplit

import numpy as np
import pandas as pd
import pytest
from page_helpers import assert_sound
from playwright.sync_api import sync_playwright
from study_helpers import NINE, grid, make_study, run_study

from accelstudy.basics.units import angles_in
from accelstudy.basics.wording import number
from accelstudy.drawing.style import APPROACH_COLOURS, model_title
from accelstudy.study.explorer import content
from accelstudy.study.explorer import page as explorer
from accelstudy.study.explorer.content import plain
from accelstudy.study.explorer.page import explorer_page, write_explorer
from accelstudy.study.figures import figure_names
from accelstudy.study.tables import TABLES

CROSS = f"{NINE}-crossaxis"
KEYS = {
    "grids": [
        grid(
            [NINE, CROSS], ["mclaren-24", "icosahedron-12"], replicates=40,
            sensor_sigma_mps2=[0.001, 0.002], robot_sigma_mgon=[0.32, 3.2],
        ),
    ],
    "leveling": {"attitudes": 10},
}  # fmt: skip
BLIND = 4
"""Set-ups of the cross-axis model with gravity alone, which nothing can estimate."""
DIGITS = 6e-4
"""Relative error of four digits."""


@pytest.fixture(scope="module")
def study():
    return make_study(**KEYS)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("study")


@pytest.fixture(scope="module")
def tables(folder):
    return run_study(folder, **KEYS)


@pytest.fixture(scope="module")
def written(study, tables, folder):
    """Path of the page, with the figures of the workflow beside it."""
    (folder / "figures").mkdir()
    for name in figure_names(study):
        (folder / "figures" / f"{name}.svg").write_text("<svg></svg>", encoding="utf-8")
    write_explorer(study, {name: tables[name] for name in TABLES}, folder / "explorer.html")
    return folder / "explorer.html"


@pytest.fixture(scope="module")
def page(written):
    return written.read_text(encoding="utf-8")


def study_of(page):
    """What the page's script reads of the study."""
    text = re.search('id="packed-study">(.*?)</script>', page)[1]
    return json.loads(gzip.decompress(base64.b64decode(text)))


def table_of(page, name):
    """A table of the page, as its script reads it."""
    return pd.DataFrame(study_of(page)[name])


def same(numbers, expected):
    """Compare numbers, none where there is none, with those of a table."""
    numbers, expected = (np.asarray(values, float) for values in (numbers, expected))
    np.testing.assert_allclose(numbers, expected, rtol=DIGITS)


# --- the data ------------------------------------------------------------------------------------


def test_set_ups_are_those_of_the_tables(page, tables):
    rows, cells = table_of(page, "setups"), tables["cells"]
    for key in ("cell", "approach"):
        assert list(rows[key]) == list(cells[key])
    assert list(rows["model"]) == [model_title(name) for name in cells["model"]]
    assert list(rows["n"]) == list(cells["n_positions"])
    same(rows["sensor-noise"], cells["sensor_sigma_mps2"] * 1e3)
    same(rows["robot-noise"], cells["robot_sigma_mgon"].where(cells["approach"] == "robot"))
    leveling = tables["leveling"].set_index("cell").reindex(cells["cell"])
    tilt = tables["quantiles"].query("quantity == 'tilt'").set_index(["cell", "name"])
    same(rows["both_q95"], leveling["both_rms_q95_mgon"])
    for angle in ("roll", "pitch"):
        same(rows[f"{angle}_rms"], leveling[f"{angle}_rms_mgon"])
        same(rows[f"{angle}_q95"], leveling[f"{angle}_rms_q95_mgon"])
        for end, probability in (("low", 0.025), ("high", 0.975)):
            quantile = tilt[np.isclose(tilt["probability"].astype(float), probability)]["value"]
            quantile = quantile.xs(angle, level="name").reindex(cells["cell"])
            same(rows[f"{angle}_{end}"], quantile)


def test_parameters_are_those_of_the_summary(page, tables):
    rows, summary = table_of(page, "parameters"), tables["summary"]
    assert list(tables["cells"]["cell"].iloc[rows["i"]]) == list(summary["cell"])
    assert list(rows["parameter"]) == [plain(name) for name in summary["parameter"]]
    assert list(rows["unit"].str.replace("²", "^2")) == list(summary["unit"])
    assert list(rows["failed"] == "") == list(summary["estimable"])
    for quantity, column in {
        "truth": "truth",
        "bias_high": "bias_ci95_high",
        "empirical": "sd_empirical",
        "posteriori": "sd_posteriori_mean",
        "linear": "sd_linear",
        "ratio": "sd_ratio",
        "ratio_low": "sd_ratio_ci95_low",
    }.items():
        same(rows[quantity], summary[column])
    same(rows["coverage_low"], summary["coverage_95_low"] * 100)
    some = rows[rows["posteriori"].notna()]
    assert len(some)
    assert some["posteriori"].between(some["posteriori_low"], some["posteriori_high"]).all()


def test_correlations_are_those_of_the_tables(page, tables):
    rows, table = table_of(page, "correlations"), tables["correlations"]
    assert list(tables["cells"]["cell"].iloc[rows["i"]]) == list(table["cell"])
    for _, cell in table.assign(shown=rows["value"].astype(float)).groupby("cell"):
        u = int(np.sqrt(len(cell)))
        shown, adjustment, empirical = (
            cell[name].to_numpy().reshape(u, u) for name in ("shown", "adjustment", "empirical")
        )
        assert np.isnan(np.diag(shown)).all()
        for triangle, expected in (
            (np.tril_indices(u, -1), adjustment),
            (np.triu_indices(u, 1), empirical),
        ):
            assert np.abs(shown[triangle] / 1000 - expected[triangle]).max() <= 0.0005


def test_failures_are_there(page, tables):
    rows = table_of(page, "setups")
    blind = rows[rows["failed"] == "not estimable"]
    assert len(blind) == BLIND
    assert set(blind["reason"]) == set(tables["cells"].query("not estimable")["reason"])
    assert blind["roll_rms"].isna().all()
    assert (blind["converged"] == 0).all()


def test_some_failed_and_an_infinite_condition(study, tables):
    """As the page's script reads them."""
    cells = tables["cells"].copy()
    sound = cells.index[cells["estimable"]]
    cells.loc[sound[0], "n_converged"] = 0
    cells.loc[sound[1], "n_converged"] = 7
    cells["condition"] = np.inf
    rows = table_of(explorer_page(study, {**tables, "cells": cells}, {}), "setups")
    assert list(rows.loc[sound[:3], "state"]) == [
        "none converged",
        "7 of 40 converged",
        "all converged",
    ]
    assert list(rows.loc[sound[:3], "failed"]) == ["none converged", "", ""]
    assert np.isinf(rows["condition"]).all()


def test_the_page_is_small_and_whole_and_the_same_again(page, study, tables):
    assert len(page.encode()) <= 1_000_000
    assert_sound(re.sub(r"<script\b.*?</script>", "", page, flags=re.DOTALL))
    assert not re.search(r'(?:src|href)="(?!figures/|#)', page)
    assert "of only the first" not in page
    assert explorer_page(study, tables, {}) == page


def test_models_and_schemes_of_the_same_title_are_told_apart(study, tables, monkeypatch):
    monkeypatch.setattr(content, "model_title", lambda name: "mine")
    rows = table_of(explorer_page(study, tables, {}), "setups")
    assert list(rows["model"]) == [f"mine ({name})" for name in tables["cells"]["model"]]
    assert set(rows["scheme"]) == {"24 McLaren", "12 icosahedron"}


def test_angles_in_degrees(study, tables):
    with angles_in("deg"):
        page = explorer_page(study, tables, {})
    read = study_of(page)
    assert read["angle"] == "mdeg"
    assert "mgon" not in read["units"]
    same(table_of(page, "setups")["roll_rms"][:1], tables["leveling"]["roll_rms_mgon"][:1] * 0.9)


def test_charts_have_the_colours_of_the_figures(page):
    charts = json.dumps(study_of(page)["charts"])
    for colour in APPROACH_COLOURS.values():
        assert colour in charts
        assert page.count(f'fill="{colour}"') == 1


def test_what_is_left_out_is_said(study, tables, monkeypatch):
    monkeypatch.setattr(explorer, "DETAILED", 10)
    page = explorer_page(study, tables, {})
    assert "the parameters and correlations of only the first 10 of 24 set-ups" in page.lower()
    assert len(table_of(page, "setups")) == 24
    simulated = tables["correlations"]["cell"].isin(tables["cells"]["cell"][:10])
    assert len(table_of(page, "correlations")) == simulated.sum()
    assert set(table_of(page, "parameters")["i"]) == set(range(10))


# --- in a browser --------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def tab():
    """A tab of a browser, and what it complained of or asked the network for."""
    path = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("chrome")
    if path is None:
        pytest.skip("no chromium on this machine")
    with sync_playwright() as playwright:
        options = ["--headless", "--no-sandbox", "--disable-gpu"]
        browser = playwright.chromium.launch(executable_path=path, args=options)
        opened = browser.new_page(viewport={"width": 1280, "height": 900})
        opened.set_default_timeout(20_000)
        opened.amiss = []
        opened.on("pageerror", lambda error: opened.amiss.append(str(error)))
        opened.on(
            "console", lambda said: opened.amiss.append(said.text) if said.type == "error" else None
        )
        opened.on(
            "request",
            lambda asked: (
                None if asked.url.startswith(("file:", "data:")) else opened.amiss.append(asked.url)
            ),
        )
        yield opened
        browser.close()


@pytest.fixture
def shown(tab, written):
    """The page as it is first seen; at the end nothing is amiss."""
    load(tab, written.as_uri())
    yield tab
    assert tab.amiss == []


def load(tab, address):
    tab.goto("about:blank")
    tab.goto(address)
    tab.wait_for_selector("#parameters tbody tr")
    tab.wait_for_selector("#chart-roll svg [aria-roledescription=point]")


def column(tab, key, table="setups"):
    """Texts of a column of a table."""
    return tab.locator(f"#{table} tbody td.{key}").all_inner_texts()


def as_number(text):
    return float(text.replace("−", "-"))


def points(tab, chart):
    """Number of points of a chart that one can see."""
    marks = f"#chart-{chart} [aria-roledescription=point]"
    return tab.locator(f"{marks}:not([opacity='0'])").count()


def limits(tab):
    """Number of lines at the tilt error that is allowed, one in each chart."""
    return tab.locator(":is(#chart-roll, #chart-pitch) .layer_0_marks line").count()


def test_the_first_sight(shown, tables):
    cells = tables["cells"]
    assert len(column(shown, "model")) == len(cells) == 24
    assert shown.locator("#count").inner_text() == "24 of 24 set-ups shown, 4 not estimable."
    assert column(shown, "state").count("× not estimable") == BLIND
    # A ring, a cross for each that cannot be estimated, a point for each of the others.
    assert points(shown, "roll") == points(shown, "pitch") == 24 + 1
    for name in shown.locator("select, input").all():
        assert shown.locator(f"label[for={name.get_attribute('id')}]").count() == 1


def test_a_choice_leaves_its_set_ups_and_shows_their_numbers(shown, tables):
    shown.select_option("#model", label=model_title(CROSS))
    shown.select_option("#scheme", label="12 icosahedron")
    shown.select_option("#sensor-noise", label="1")
    shown.select_option("#robot-noise", label="0.32")
    chosen = tables["cells"].query(
        "model == @CROSS and scheme == 'icosahedron-12' and sensor_sigma_mps2 == 0.001 and "
        "(approach == 'gravity' or robot_sigma_mgon < 1)"
    )
    assert len(column(shown, "model")) == len(chosen) == 2
    assert column(shown, "state") == ["× not estimable", "all converged"]
    (robot,) = chosen.query("approach == 'robot'")["cell"]
    tilt = tables["leveling"].set_index("cell").loc[robot]
    facts = shown.locator("#facts p")
    (reason,) = set(chosen.query("not estimable")["reason"])
    assert facts.nth(0).inner_text() == f"gravity, sensor noise 1 mm/s²: not estimable; {reason}."
    said = re.findall(r"([\d.]+) mgon rms \(95 % below ([\d.]+)\)", facts.nth(1).inner_text())
    left = [[tilt[f"{angle}_rms{end}_mgon"] for end in ("", "_q95")] for angle in ("roll", "pitch")]
    assert np.array(said, float) == pytest.approx(np.array(left), abs=0.011)
    (both,) = re.findall(r"95 % below ([\d.]+) in both", facts.nth(1).inner_text())
    assert float(both) == pytest.approx(tilt["both_rms_q95_mgon"], abs=0.011)
    its = tables["summary"][tables["summary"]["cell"] == robot]
    for key, name in (("empirical", "sd_empirical"), ("linear", "sd_linear")):
        assert column(shown, key, "parameters")[-len(its) :] == [number(x) for x in its[name]]
    assert column(shown, "empirical", "parameters")[: len(its)] == ["–"] * len(its)
    # The charts show the one that there is.
    assert points(shown, "roll") == 1 + 2
    assert points(shown, "coverage") == len(its)
    assert not shown.locator("#correlations-0").is_visible()
    fields = shown.locator("#chart-correlations-1 [aria-roledescription='rect mark']")
    assert fields.count() == len(its) ** 2
    # Choices that nothing would be left of cannot be made.
    shown.select_option("#approach", label="gravity")
    assert shown.locator("#state option").count() == 3
    assert len(column(shown, "model")) == 1
    assert not shown.locator("#drawn").is_visible()
    shown.click("button[type=reset]")
    shown.wait_for_function("document.querySelectorAll('#setups tbody tr').length === 24")


def test_a_click_on_a_row_or_on_a_point_chooses_its_set_up(shown, tables):
    shown.locator("#setups tbody tr", has_text="robot").first.locator("button").click()
    assert shown.locator("#setups tr[aria-current=true]").count() == 1
    assert "robot" in shown.locator("#setups tr[aria-current=true]").inner_text()
    shown.select_option("#by", label="Scheme")
    shown.select_option("#approach", label="gravity")
    shown.select_option("#sensor-noise", label="2")
    shown.select_option("#model", label=model_title(NINE))
    assert "24 McLaren" in shown.locator("#name").inner_text()
    mark = "#chart-pitch [aria-label*='12 icosahedron'][aria-roledescription=point]"
    shown.locator(f"{mark}:not([opacity='0'])").click(force=True)
    assert "12 icosahedron" in shown.locator("#name").inner_text()
    its = tables["summary"]
    its = its[its["cell"] == f"{NINE}/icosahedron-12/gravity"]
    assert column(shown, "empirical", "parameters") == [number(x) for x in its["sd_empirical"]]


def test_the_table_sorts_by_a_click_or_a_key(shown, tables):
    # The page holds four digits.
    expected = [float(f"{x:.4g}") for x in tables["leveling"]["roll_rms_mgon"].sort_values()]
    head = shown.locator("#setups th[data-key=roll_rms]")
    head.locator("button").click()
    assert head.get_attribute("aria-sort") == "ascending"
    none = ["–"] * BLIND
    assert column(shown, "roll_rms") == [number(x) for x in expected] + none
    head.locator("button").press("Enter")
    assert head.get_attribute("aria-sort") == "descending"
    assert column(shown, "roll_rms") == [number(x) for x in expected[::-1]] + none
    shown.locator("#parameters th[data-key=empirical] button").click()
    values = [as_number(x) for x in column(shown, "empirical", "parameters")]
    assert values == sorted(values)
    # What is chosen, and how it is sorted, is a part of the address.
    shown.fill("#need", "15")
    kept = column(shown, "roll_rms")
    load(shown, shown.url)
    assert shown.input_value("#need") == "15"
    assert limits(shown) == 2
    assert column(shown, "roll_rms") == kept
    assert head.get_attribute("aria-sort") == "descending"
    shown.click("button[type=reset]")
    shown.wait_for_function("document.querySelectorAll('#setups tbody tr').length === 24")
    assert limits(shown) == 0


def test_filters_by_tilt_error_and_by_state(shown, tables):
    most = tables["leveling"]["both_rms_q95_mgon"]
    limit = float(f"{most.median():.3g}")
    assert limits(shown) == 0
    shown.fill("#need", str(limit))
    assert limits(shown) == 2
    left = (most <= limit).sum()
    assert 0 < left < len(most)
    assert len(column(shown, "model")) == left
    assert shown.locator("#count").inner_text() == f"{left} of 24 set-ups shown."
    shown.evaluate("window.stays = true")
    shown.press("#need", "Enter")
    assert shown.evaluate("window.stays")  # the page is not loaded again
    assert len(column(shown, "model")) == left
    shown.fill("#need", "")
    shown.select_option("#state", "failed")
    assert column(shown, "state") == ["× not estimable"] * BLIND
    assert points(shown, "roll") == BLIND
    # Charts that come back have the width of the window as it is now.
    shown.select_option("#approach", label="gravity")
    assert not shown.locator("#drawn").is_visible()
    shown.set_viewport_size({"width": 1100, "height": 900})
    shown.select_option("#approach", "")
    shown.select_option("#state", "sound")
    assert len(column(shown, "model")) == 24 - BLIND
    shown.wait_for_function("document.querySelector('#chart-ratio svg').clientWidth > 300")
    shown.set_viewport_size({"width": 1280, "height": 900})


def test_links_go_to_figures_that_exist(shown, written, study):
    links = shown.locator("[data-figure]").all()
    assert len(links) == len(figure_names(study))
    for link in links:
        path = unquote(urlsplit(link.evaluate("link => link.href")).path)
        assert (written.parent / "figures" / path.rpartition("/")[2]).is_file()
        assert path.startswith(str(written.parent))


def test_a_narrow_screen(shown):
    shown.set_viewport_size({"width": 390, "height": 800})
    # The charts follow the new width a moment later.
    shown.wait_for_function("document.documentElement.scrollWidth <= 390")
    assert shown.evaluate("document.documentElement.scrollWidth") <= 390
    assert shown.locator("#chart-roll svg").bounding_box()["width"] <= 390
    shown.set_viewport_size({"width": 1280, "height": 900})
