"""The page of an explorer: everything in one file, its tables and its libraries packed.

Charts are Altair's, and tables are those of DataTables, which `itables` brings. Selections of
Altair link charts of one specification, whose widths are fixed, and no table; so what is chosen in
a table comes to the charts by a script of the page.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from importlib.metadata import version
from importlib.resources import files
from pathlib import Path

import pandas as pd

from accelstudy.basics.units import angles_in, display_unit
from accelstudy.basics.wording import comma_list, plural
from accelstudy.files.cache import cached
from accelstudy.files.outputs import whole_file
from accelstudy.pages import render
from accelstudy.study.config import Study
from accelstudy.study.explorer import charts
from accelstudy.study.explorer.content import (
    compress,
    noise_levels,
    parameters,
    records,
    setups,
)
from accelstudy.study.tables import TABLES

QUANTITIES = {
    "parameter": "parameter",
    "approach": "approach",
    "unit": "unit",
    "truth": "truth",
    "bias": "bias (95 % interval)",
    "sd_empirical": "empirical sd",
    "sd_posteriori_mean": "sd a posteriori (central 95 %)",
    "sd_linear": "linear theory",
    "sd_ratio": "ratio of the sds (95 % interval)",
    "coverage_95": "coverage (95 % interval)",
}
"""Columns of the parameters of a set-up, and their titles."""


def write_explorer(study: Study, tables: Mapping[str, pd.DataFrame], output: str | Path) -> None:
    """Write the explorer of a study.

    Parameters
    ----------
    study : Study
    tables : mapping of name to DataFrame: cells, summary, leveling and quantiles
    output : path of the page
    """
    with angles_in(study.angle_unit):
        page = explorer_page(study, tables)
    with whole_file(output) as path:
        path.write_text(page, encoding="utf-8")


def explorer_page(study: Study, tables: Mapping[str, pd.DataFrame]) -> str:
    """Return the page; parameters as in `write_explorer`."""
    cells, unit = tables["cells"], display_unit("rad")
    rows, titles = setups(cells, tables)
    details, levels = parameters(cells, tables), noise_levels(cells)
    approaches, units = list(rows["approach"].unique()), list(details["unit"].unique())
    noises = [factor.name for factor in levels if factor.name in titles]
    fields = {name: titles[name] for name in ("model", "scheme", "n", *noises)}
    page = {
        **{"approaches": approaches, "fields": [*fields], "start": _start(study, cells)},
        "columns": {"setups": titles, "parameters": QUANTITIES},
        "charts": charts.all_charts(approaches, [*fields]),
    }
    fixed = [
        f"{factor.title} {level.max():.4g} {factor.shown_unit}"
        for factor, level in levels.items()
        if level.min() == level.max() != 0
    ]
    bundle = files("itables") / "html"
    calibrations = f"{int(cells['n_replicates'].sum()):,}".replace(",", "\u202f")
    return render(
        "study/explorer/explorer.html.j2",
        study=study.study,
        counts=f"{plural(len(cells), 'set-up')} with {calibrations} simulated calibrations.",
        fixed=comma_list(fixed),
        fields=fields,
        by=next(iter(noises), "scheme" if len(set(rows["scheme"])) > 1 else "model"),
        unit=unit,
        units=units,
        tables=comma_list([f"{name}.parquet" for name in TABLES]),
        packed={
            "vega": vega(),
            "datatables": compress((bundle / "dt_bundle.js").read_text("utf-8")),
            "style": compress((bundle / "dt_bundle.css").read_text("utf-8")),
            "page": compress(json.dumps(page)),
            "setups": compress(records(rows)),
            "parameters": compress(records(details)),
        },
    )


def _start(study: Study, cells: pd.DataFrame) -> int:
    """Number of the set-up that is chosen first: the paper's, else the first that is estimable."""
    names = list(cells["cell"])
    if study.sensitivity is not None:
        return names.index(study.sensitivity.cell("gravity"))
    return int(cells["estimable"].to_numpy(bool).argmax())


def vega() -> str:
    """Return Vega-Embed, with all it needs, as vl-convert bundles it, packed.

    To bundle it takes two seconds, so the text is kept for the next study.
    """
    return cached("explorer", f"vega-{version('vl-convert-python')}", _bundled, bytes.decode)


def _bundled() -> bytes:
    import vl_convert

    return compress(vl_convert.javascript_bundle("window.vegaEmbed = vegaEmbed;")).encode()
