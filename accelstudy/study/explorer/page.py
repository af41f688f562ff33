"""The page of an explorer: everything in one file, its tables and its library packed.

Charts are Altair's. Its own selections would link charts of one specification, whose widths are
fixed, and no table; so a script of the page links controls, charts and tables.
"""

from __future__ import annotations

import base64
import gzip
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple

import pandas as pd

from accelstudy.basics.units import angles_in, display_unit, unit_label
from accelstudy.basics.wording import comma_list, counted
from accelstudy.drawing.style import approach_colour, approach_marker
from accelstudy.files.cache import cached
from accelstudy.files.outputs import whole_file
from accelstudy.pages import render
from accelstudy.study.config import Study
from accelstudy.study.explorer import charts
from accelstudy.study.explorer.content import (
    ANGLES,
    correlations,
    noise_levels,
    packed,
    parameters,
    setups,
)
from accelstudy.study.figures import angle_unit, figure_names, get_figure
from accelstudy.study.figures.factors import FACTORS, POSITIONS, Factor, varies
from accelstudy.study.tables import TABLES

DETAILED = 2000
"""Set-ups that are on the page with their parameters and correlations."""
TEMPLATE = "study/explorer/explorer.html.j2"
PATHS = {
    "o": "M-4,0a4,4 0 1,0 8,0a4,4 0 1,0 -8,0",
    "s": "M-4,-4h8v8h-8z",
    "D": "M0,-5L5,0L0,5L-5,0z",
}
"""Markers of the figures, for the legend."""


class Column(NamedTuple):
    """A column of a table: its key in the data, and its head."""

    key: str
    title: str
    unit: str = ""


TEXTS = ("model", "scheme", "approach", "state", "parameter", "unit")
"""Columns of texts; the others are numbers."""
FIELDS = [Column(name, name) for name in ("model", "scheme", "approach")]
FIELDS.append(Column("n", "positions"))
"""What can be chosen, with the noises that a study varies."""
PARAMETER_COLUMNS = (
    Column("parameter", "parameter"),
    Column("approach", "approach"),
    Column("unit", "unit"),
    Column("truth", "truth"),
    Column("bias", "bias (95 % interval)"),
    Column("empirical", "empirical sd"),
    Column("posteriori", "sd a posteriori (central 95 %)"),
    Column("linear", "linear theory"),
    Column("closed", "closed form"),
    Column("ratio", "ratio of the sds (95 % interval)"),
    Column("coverage", "coverage (95 % interval)", "%"),
)
"""Columns of the parameters of a set-up."""


def write_explorer(
    study: Study,
    tables: Mapping[str, pd.DataFrame],
    output: str | Path,
    in_report: Mapping[str, str] | None = None,
) -> None:
    """Write the explorer of a study.

    Parameters
    ----------
    study : Study
    tables : mapping of name to DataFrame, those of `TABLES`
    output : path of the page; the figures are in the folder `figures` beside it
    in_report : where a report has the figures, seen from the page there, by their names
    """
    with angles_in(angle_unit(study)):
        page = explorer_page(study, tables, in_report or {})
    with whole_file(output) as path:
        path.write_text(page, encoding="utf-8")


def explorer_page(
    study: Study, tables: Mapping[str, pd.DataFrame], in_report: Mapping[str, str]
) -> str:
    """Return the page; parameters as in `write_explorer`."""
    cells, unit = tables["cells"], display_unit("rad")
    rows, sds = setups(cells, tables)
    details = parameters(cells.head(DETAILED), tables)
    levels = noise_levels(cells)
    noises = [Column(f.name, f.title, _unit(f)) for f in levels if f.name in rows]
    approaches, units = list(rows["approach"].unique()), list(details["unit"].unique())
    fields = [*FIELDS, *noises]
    columns = [
        *fields,
        Column("state", "state"),
        *(
            Column(f"{angle}_{name}", f"{angle} {title}", unit)
            for angle in ANGLES
            for name, title in (("rms", "rms"), ("q95", "95 % below"))
        ),
        Column("both_q95", "both 95 % below", unit),
        *(Column(key, *titles) for key, titles in sds.items()),
        Column("redundancy", "redundancy"),
        Column("condition", "condition"),
        Column("replicates", "calibrations"),
    ]
    content = {
        "setups": rows,
        "parameters": details,
        "correlations": correlations(cells.head(DETAILED), tables),
        "approaches": approaches,
        "noises": {noise.key: [noise.title, noise.unit] for noise in noises},
        **{"units": units, "angle": unit, "detailed": DETAILED},
        **{"start": _start(study, cells), "report": dict(in_report)},
        **{"look": charts.look(), "charts": charts.all_charts(approaches)},
    }
    fixed = [
        f"{factor.title} {level.max():.4g} {_unit(factor)}"
        for factor, level in levels.items()
        if len(level.dropna().unique()) == 1 and level.max() != 0
    ]
    calibrations = f"{int(cells['n_replicates'].sum()):,}".replace(",", "\u202f")
    return render(
        TEMPLATE,
        study=study.study,
        counts=f"{counted(len(cells), 'set-up')} with {calibrations} simulated calibrations.",
        left_out=len(cells) if len(cells) > DETAILED else 0,
        detailed=DETAILED,
        fixed=comma_list(fixed),
        fields=fields,
        by=_first_rows(study, rows),
        columns=columns,
        quantities=PARAMETER_COLUMNS,
        texts=TEXTS,
        unit=unit,
        units=units,
        approaches=[
            {"name": name, "colour": approach_colour(name), "path": PATHS[approach_marker(name)]}
            for name in approaches
        ],
        figures=[{"name": name, "title": get_figure(name).title} for name in figure_names(study)],
        tables=comma_list([f"{name}.parquet" for name in TABLES]),
        packed={"library": library(), "study": packed(content)},
    )


def _first_rows(study: Study, rows: pd.DataFrame) -> str:
    """What the rows of the chart are at first: what the study varies."""
    for factor in FACTORS:
        if varies(study, factor):
            return "n" if factor is POSITIONS else factor.name
    return "scheme" if len(rows["scheme"].unique()) > 1 else "model"


def _unit(factor: Factor) -> str:
    return "" if factor.unit == "1" else unit_label(display_unit(factor.unit))


def _start(study: Study, cells: pd.DataFrame) -> int:
    """Number of the set-up that is chosen first: the paper's, else the first that is estimable."""
    names = list(cells["cell"])
    if study.sensitivity is not None:
        return names.index(study.sensitivity.cell("gravity"))
    return int(cells["estimable"].to_numpy(bool).argmax())


def library() -> str:
    """Return Vega-Embed, with all it needs, as vl-convert bundles it, gzipped, in base 64.

    To bundle it takes two seconds, so the text is kept for the next study.
    """
    return cached("explorer", f"vega-{version('vl-convert-python')}", _bundled, bytes.decode)


def _bundled() -> bytes:
    import vl_convert

    code = vl_convert.javascript_bundle("window.vegaEmbed = vegaEmbed;")
    return base64.b64encode(gzip.compress(code.encode(), mtime=0))
