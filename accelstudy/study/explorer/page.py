"""The page of an explorer: one file with its tables and its libraries.

Charts are Altair's, and the table is that of DataTables, which `itables` brings. Selections of
Altair link charts, and no table; so what is chosen in the table comes to the charts by a script.
"""

from __future__ import annotations

import base64
from collections.abc import Mapping
from importlib.metadata import version
from importlib.resources import files

import pandas as pd

from accelstudy.basics.wording import comma_list, plural
from accelstudy.files.cache import cached
from accelstudy.pages import render
from accelstudy.study.config import Study
from accelstudy.study.explorer.charts import explorer_charts
from accelstudy.study.explorer.content import parameters, setups
from accelstudy.study.figures.factors import NOISES
from accelstudy.study.tables import TABLES

OPTIONS = {
    "order": [],
    "scrollX": True,
    "select": {"style": "single", "info": False, "toggleable": False},
    "pageLength": 6,
    "layout": {"top1": "searchPanes", "topStart": "searchBuilder", "topEnd": "search"},
    "language": {
        "searchBuilder": {"title": "", "add": "Add a condition, such as both 95 % below < 10"}
    },
}
"""Of the table of set-ups, for DataTables."""
PANES = {"cascadePanes": True, "orderable": False, "initCollapsed": True, "layout": "columns-4"}
"""Of the panes by which it is filtered."""


def explorer_page(study: Study, tables: Mapping[str, pd.DataFrame]) -> str:
    """Return the explorer of a study, in the unit of angles that holds.

    Parameters
    ----------
    study : Study
    tables : mapping of name to DataFrame: cells, summary, leveling and quantiles
    """
    cells = tables["cells"]
    rows, titles = setups(cells, tables)
    names = ["model", "scheme", "n", *(factor.name for factor in NOISES)]
    fields = {
        name: titles[name] for name in names if name in titles and len({*rows[name].dropna()}) > 1
    }
    shown = [i for i, name in enumerate(titles) if name in fields or name == "approach"]
    columns = [{"data": name, "title": title} for name, title in titles.items()]
    bundle = files("itables") / "html"
    calibrations = f"{int(cells['n_replicates'].sum()):,}".replace(",", "\u202f")
    return render(
        "study/explorer/explorer.html.j2",
        study=study.study,
        counts=f"{plural(len(cells), 'set-up')} with {calibrations} simulated calibrations.",
        tables=comma_list([f"{name}.parquet" for name in TABLES]),
        charts=explorer_charts(rows, parameters(cells, tables, rows), fields),
        options={**OPTIONS, "columns": columns, "searchPanes": {**PANES, "columns": shown}},
        start=_start(study, cells),
        datatables=base64.b64encode((bundle / "dt_bundle.js").read_bytes()).decode(),
        style=(bundle / "dt_bundle.css").read_text("utf-8"),
        # To bundle it takes two seconds, so the text is kept for the next study.
        vega=cached("explorer", f"vega-embed-{version('vl-convert-python')}", _vega, bytes.decode),
    )


def _start(study: Study, cells: pd.DataFrame) -> int:
    """Number of the set-up that is chosen first: the paper's, else the first that is estimable."""
    names = list(cells["cell"])
    if study.sensitivity is not None:
        return names.index(study.sensitivity.cell("gravity"))
    return int(cells["estimable"].to_numpy(bool).argmax())


def _vega() -> bytes:
    """Vega-Embed with all that it needs."""
    import vl_convert

    return vl_convert.javascript_bundle("window.vegaEmbed = vegaEmbed;").encode()
