"""The explorer shows what the tables hold; in a browser, what a person chooses of it."""

import json
import re
import shutil
from itertools import product

import numpy as np
import pandas as pd
import pytest
from page_helpers import assert_sound
from playwright.sync_api import sync_playwright
from study_helpers import NINE, grid, make_study, run_study

from accelstudy.basics.units import angles_in
from accelstudy.drawing.style import model_title
from accelstudy.study.explorer import content
from accelstudy.study.explorer.page import explorer_page
from accelstudy.study.tables import TABLES

CROSS = f"{NINE}-crossaxis"
KEYS = {
    "grids": [
        grid(
            [NINE, CROSS], ["mclaren-24", "icosahedron-12"], replicates=40,
            robot_sigma_mgon=[0.32, 3.2],
        ),
    ],
    "leveling": {"attitudes": 10},
}  # fmt: skip
BLIND = 2
"""Set-ups of the cross-axis model with gravity alone, which nothing can estimate."""
DIGITS = 6e-4
"""Relative error of four digits."""


@pytest.fixture(scope="module")
def study():
    return make_study(**KEYS)


@pytest.fixture(scope="module")
def tables(tmp_path_factory):
    return run_study(tmp_path_factory.mktemp("study"), **KEYS)


@pytest.fixture(scope="module")
def page(study, tables):
    return explorer_page(study, {name: tables[name] for name in TABLES})


@pytest.fixture
def one_title(monkeypatch):
    """All models have one title, which looks like markup."""
    monkeypatch.setattr(content, "model_title", lambda name: "<b>mine</b>")


def charts(page):
    """The charts of the page, with their data."""
    return json.loads(re.search(r"const spec = (.*);\n", page)[1])


def table_of(page, name):
    """A table of the page."""
    return pd.DataFrame(charts(page)["datasets"][name])


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
    leveling = tables["leveling"].set_index("cell").reindex(cells["cell"])
    same(rows["sensor-noise"], cells["sensor_sigma_mps2"] * 1e3)
    same(rows["robot-noise"], cells["robot_sigma_mgon"].where(cells["approach"] == "robot"))
    same(rows["both_q95"], leveling["both_rms_q95_mgon"])
    tilt = tables["quantiles"].query("quantity == 'tilt'").set_index(["cell", "name"])
    for angle, (end, probability) in product(
        ("roll", "pitch"), (("low", 0.025), ("high", 0.975), ("q95", None), ("rms", None))
    ):
        if probability is None:
            expected = leveling[f"{angle}_rms{'_q95' * (end == 'q95')}_mgon"]
        else:
            quantile = tilt[np.isclose(tilt["probability"].astype(float), probability)]["value"]
            expected = quantile.xs(angle, level="name").reindex(cells["cell"])
        same(rows[f"{angle}_{end}"], expected)
    blind = rows[rows["state"].str.startswith("not estimable: ")]
    assert len(blind) == BLIND
    assert set(blind["state"].str.removeprefix("not estimable: ")) == set(
        cells.query("not estimable")["reason"]
    )
    assert blind["roll_rms"].isna().all()


SUMMARY = ("truth", "bias", "sd_empirical", "sd_posteriori_mean", "sd_linear")


def test_parameters_are_those_of_the_tables(page, tables):
    rows, summary = table_of(page, "parameters"), tables["summary"]
    for name in ("approach", "parameter"):
        assert list(rows[name]) == list(summary[name])
    assert list(rows["unit"].str.replace("²", "^2")) == list(summary["unit"])
    for name in (*SUMMARY, "sd_ratio", "coverage_95"):
        same(rows[name], summary[name])
    mean = "sd_posteriori_mean"
    some = rows[rows[mean].notna()]
    assert some[mean].between(some[f"{mean}_low"], some[f"{mean}_high"]).all()


def test_the_page_is_whole_and_the_same_again(page, study, tables):
    assert len(page.encode()) <= 3_000_000
    markup = re.sub(r"<script\b.*?</script>", "", page, flags=re.DOTALL)
    assert_sound(markup)
    assert not re.search(r'(?:src|href)="(?!#)', markup)
    assert explorer_page(study, tables) == page


@pytest.mark.usefixtures("one_title")
def test_failures_models_of_one_title_and_degrees(study, tables):
    """Of two set-ups some calibrations failed, and all have an infinite condition."""
    cells = tables["cells"].assign(condition=np.inf)
    sound = cells.index[cells["estimable"]]
    cells.loc[sound[:2], "n_converged"] = [0, 7]
    with angles_in("deg"):
        other = explorer_page(study, {**tables, "cells": cells})
    rows = table_of(other, "setups")
    states = [f"{n} of 40 converged" for n in (0, 7, 40)]
    assert list(rows.loc[sound[:3], "state"]) == states
    assert rows["condition"].isna().all()
    # Models of the same title are told apart.
    assert list(rows["model"]) == [f"<b>mine</b> ({name})" for name in tables["cells"]["model"]]
    assert set(rows["scheme"]) == {"24 McLaren", "12 icosahedron"}
    assert "mgon" not in json.dumps(charts(other)["vconcat"], ensure_ascii=False)
    same(rows["roll_rms"][:1], tables["leveling"]["roll_rms_mgon"][:1] * 0.9)


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
        opened.set_default_timeout(60_000)
        opened.amiss = []
        opened.on("pageerror", lambda error: opened.amiss.append(str(error)))

        def complaint(said):
            if said.type == "error":
                opened.amiss.append(said.text)

        def request(asked):
            if not asked.url.startswith(("file:", "data:", "blob:")):
                opened.amiss.append(asked.url)

        opened.on("console", complaint)
        opened.on("request", request)
        yield opened
        browser.close()


def load(tab, address):
    tab.goto("about:blank")
    tab.goto(address)
    tab.wait_for_selector("#setups tbody tr.selected")
    tab.wait_for_selector("#charts svg [aria-roledescription=point]")


def rows(tab):
    """Rows of the table, each with its texts by the heads of the columns."""
    titles = ".dt-scroll-head:has(+ .dt-scroll-body #setups) .dt-column-title"
    heads = tab.locator(titles).all_inner_texts()
    lines = tab.locator("#setups tbody tr").all()
    texts = [line.locator("td").all_inner_texts() for line in lines]
    return pd.DataFrame(texts, columns=[head.replace("\n", " ") for head in heads])


def points(tab, number):
    """Wait until one can see so many points of both tilt charts together, with the rings."""
    marks = "#charts [aria-roledescription=point][aria-label*=state]:not([opacity='0'])"
    tab.wait_for_function(f"document.querySelectorAll({marks!r}).length == {number}")


def count(tab, number):
    """Wait until so many set-ups are shown."""
    tab.wait_for_function(
        f"document.querySelector('#setups_info').innerText.includes('of {number} entries')"
    )


def choose(tab, value):
    """Choose a value in a pane, all of which are open."""
    tab.locator(".dtsp-searchPane td", has_text=value).first.click()


def test_a_choice_leaves_its_set_ups_shows_their_numbers_and_is_a_part_of_the_address(
    tab, page, tables, tmp_path
):
    (tmp_path / "explorer.html").write_text(page, encoding="utf-8")
    load(tab, (tmp_path / "explorer.html").as_uri())
    count(tab, 12)
    assert list(rows(tab)["model"]) == [model_title(name) for name in tables["cells"]["model"][:6]]
    # A ring, and a point for each set-up that can be estimated; the others have a cross.
    points(tab, 2 * (12 - BLIND + 1))
    crosses = "#charts [aria-roledescription='text mark']:not([opacity='0'])"
    assert tab.locator(crosses).count() == 2 * BLIND
    # Rows of the charts.
    tab.select_option("#by select", label="model")
    tab.wait_for_selector(f"#charts text:has-text('{model_title(CROSS)}')")
    # Set-ups that are left.
    tab.get_by_text("Show All").click()
    choose(tab, "robot")
    count(tab, 8)
    points(tab, 2 * 8)
    # Their order, and the one whose numbers are shown.
    tab.locator(".dt-scroll-head th", has_text="roll rms").click()
    of_left = tables["leveling"].query("approach == 'robot'").set_index("cell")
    of_left = of_left["roll_rms_mgon"].sort_values()
    first = rows(tab)
    same(first["roll rms / mgon"].astype(float), of_left[:6])
    tab.locator("#setups tbody tr").nth(3).click()
    assert tab.locator("#setups tr.selected").count() == 1
    points(tab, 2 * (8 + 1))
    said = tab.locator("#chosen").inner_text()
    assert f"(in the tables {of_left.index[3]}): 40 of 40 converged" in said
    # All again from the address.
    load(tab, tab.url)
    count(tab, 8)
    pd.testing.assert_frame_equal(rows(tab), first)
    assert tab.locator("#chosen").inner_text() == said
    points(tab, 2 * (8 + 1))
    assert tab.amiss == []


@pytest.mark.usefixtures("one_title")
def test_schemes_without_redundancy_and_names_that_are_no_markup(tab, tmp_path):
    keys = {"grids": [grid("bias-scale", ["faces-6", "fibonacci-6"], 2, approaches="gravity")]}
    page = explorer_page(make_study(**keys), run_study(tmp_path, **keys))
    (tmp_path / "six.html").write_text(page, encoding="utf-8")
    load(tab, (tmp_path / "six.html").as_uri())
    points(tab, 2 * (2 + 1))
    assert list(rows(tab)["model"]) == 2 * ["<b>mine</b>"]
    assert tab.amiss == []
