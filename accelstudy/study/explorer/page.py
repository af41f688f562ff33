"""The page of an explorer: everything in one file, its tables and its library packed."""

from __future__ import annotations

import base64
import gzip
import json
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from accelstudy.basics.units import angles_in, display_unit, unit_label
from accelstudy.basics.wording import comma_list, counted
from accelstudy.drawing.style import approach_colour, approach_marker, model_title
from accelstudy.files.kept import kept_or_made
from accelstudy.files.outputs import whole_file
from accelstudy.files.tables import read_table
from accelstudy.pages import render
from accelstudy.schemes import get_scheme
from accelstudy.sensors.models import PRESETS
from accelstudy.study.beyond_linear_theory import is_compared
from accelstudy.study.config import StudyConfig
from accelstudy.study.explorer import charts
from accelstudy.study.explorer.content import (
    ANGLES,
    correlations,
    levels,
    packed,
    parameters,
    setups,
    varied,
    without_robot,
)
from accelstudy.study.figures import angle_unit, figure_names, get_figure
from accelstudy.study.figures.factors import (
    FACTORS,
    NOISES,
    POSITIONS,
    Factor,
    blocks,
    family,
    varies,
)
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
    study: StudyConfig,
    tables: Mapping[str, str | Path],
    output: str | Path,
    in_report: Mapping[str, str] | None = None,
) -> None:
    """Write the explorer of a study.

    Parameters
    ----------
    study : StudyConfig
    tables : paths of `TABLES`
    output : path of the page; the figures are in the folder `figures` beside it
    in_report : where a report has the figures, seen from the page there, by their names
    """
    read = {name: read_table(tables[name]) for name in TABLES}
    with angles_in(angle_unit(study)):
        page = explorer_page(study, read, in_report or {})
    with whole_file(output) as path:
        path.write_text(page, encoding="utf-8")


def explorer_page(
    study: StudyConfig, tables: Mapping[str, pd.DataFrame], in_report: Mapping[str, str]
) -> str:
    """Return the page; parameters as in `write_explorer`, but the tables themselves."""
    cells = without_robot(tables["cells"])
    factors = varied(cells)
    titles = {
        "model": [model_title(name) for name in cells["model"].unique()],
        "scheme": [get_scheme(name).title for name in cells["scheme"].unique()],
        "approach": list(cells["approach"].unique()),
    }
    rows, groups = setups(cells, tables, figures_of(study, cells.to_dict("records")))
    parts = {
        "setups": rows,
        "parameters": parameters(cells.head(DETAILED), tables),
        "correlations": correlations(cells.head(DETAILED), tables),
    }
    units = list(parts["parameters"]["unit"].unique())
    content = {
        "titles": titles,
        "names": {key: list(cells[key].unique()) for key in ("model", "scheme")},
        "families": [family(name) for name in cells["scheme"].unique()],
        "units": units,
        "angle": display_unit("rad"),
        "noises": {factor.name: [factor.title, _unit(factor)] for factor in factors},
        "detailed": DETAILED,
        "start": _start(study, cells),
        "report": dict(in_report),
        "look": charts.look(),
        "charts": charts.all_charts(titles["approach"]),
    }
    return render(
        TEMPLATE,
        study=study.study,
        counts=_counts(cells),
        left_out=_left_out(cells),
        fixed=_fixed(cells),
        controls=_controls(cells, titles),
        by=_first_rows(study, titles),
        columns=_columns(factors, groups),
        quantities=PARAMETER_COLUMNS,
        texts=("model", "scheme", "approach", "state", "parameter", "unit"),
        unit=display_unit("rad"),
        units=units,
        approaches=[
            {"name": name, "colour": approach_colour(name), "path": PATHS[approach_marker(name)]}
            for name in titles["approach"]
        ],
        figures=[{"name": name, "title": get_figure(name).title} for name in figure_names(study)],
        tables=comma_list([f"{name}.parquet" for name in TABLES]),
        # No text of the data can end the element that it stands in.
        content=json.dumps(content, ensure_ascii=False, separators=(",", ":")).replace(
            "<", "\\u003c"
        ),
        packed={"library": library(), **{name: packed(table) for name, table in parts.items()}},
    )


def _left_out(cells: pd.DataFrame) -> str:
    """Say what is not on the page."""
    if len(cells) <= DETAILED:
        return ""
    return (
        f"The parameters and correlations of only the first {DETAILED} of {len(cells)} set-ups "
        "are here. Those of the others are in the tables."
    )


def _counts(cells: pd.DataFrame) -> str:
    """Say how many set-ups there are, and how many failed."""
    blind = int((~cells["estimable"]).sum())
    none = int((cells["estimable"] & (cells["n_converged"] == 0)).sum())
    some = int(cells["n_converged"].between(1, cells["n_replicates"] - 1).sum())
    failed = [
        f"{count} {what}"
        for count, what in (
            (blind, "cannot be estimated"),
            (none, "did not converge at all"),
            (some, "converged in a part of their calibrations"),
        )
        if count
    ]
    calibrations = f"{int(cells['n_replicates'].sum()):,}".replace(",", "\u202f")
    total = f"{counted(len(cells), 'set-up')} with {calibrations} simulated calibrations"
    return f"{total}; of the set-ups, {comma_list(failed)}." if failed else f"{total}."


def _fixed(cells: pd.DataFrame) -> str:
    """Say which noise is the same in all set-ups."""
    parts = []
    for factor in NOISES:
        values = levels(cells, factor)
        values = values[~np.isnan(values)]
        if len(values) and len(np.unique(values)) == 1 and values[0] != 0:
            parts.append(f"{factor.title} {values[0]:.4g} {_unit(factor)}")
    return comma_list(parts)


def _controls(cells: pd.DataFrame, titles: Mapping[str, Sequence[str]]) -> list[dict[str, Any]]:
    """What can be chosen: a title and options, each with its value and text."""
    controls: list[dict[str, Any]] = [
        {"key": key, "title": key, "options": list(enumerate(options))}
        for key, options in titles.items()
    ]
    for factor, key in ((POSITIONS, "n"), *((noise, noise.name) for noise in varied(cells))):
        values = np.unique(levels(cells, factor))
        options = [(f"{value:.4g}", f"{value:.4g}") for value in values[~np.isnan(values)]]
        controls.append(
            {"key": key, "title": factor.title, "unit": _unit(factor), "options": options}
        )
    return controls


def _first_rows(study: StudyConfig, titles: Mapping[str, Sequence[str]]) -> str:
    """What the rows of the chart are at first: what the study varies."""
    swept = [factor for factor in FACTORS if varies(study, factor)]
    if swept:
        return "n" if swept[0] is POSITIONS else swept[0].name
    return "scheme" if len(titles["scheme"]) > 1 else "model"


def _columns(factors: Sequence[Factor], groups: Sequence[Mapping[str, str]]) -> list[Column]:
    """Columns of the set-ups."""
    unit = display_unit("rad")
    return [
        Column("model", "model"),
        Column("scheme", "scheme"),
        Column("n", "positions"),
        Column("approach", "approach"),
        *(Column(factor.name, factor.title, _unit(factor)) for factor in factors),
        Column("state", "state"),
        *(
            Column(f"{angle}_{name}", f"{angle} {title}", unit)
            for angle in ANGLES
            for name, title in (("rms", "rms"), ("q95", "95 % below"))
        ),
        Column("both_q95", "both 95 % below", unit),
        *(
            Column(f"sd-{i}", f"sd of {group['label']}", group["unit"])
            for i, group in enumerate(groups)
        ),
        Column("redundancy", "redundancy"),
        Column("condition", "condition"),
        Column("replicates", "calibrations"),
    ]


def _unit(factor: Factor) -> str:
    return "" if factor.unit == "1" else unit_label(display_unit(factor.unit))


def _start(study: StudyConfig, cells: pd.DataFrame) -> int:
    """Number of the set-up that is chosen first: the paper's, else the first that is estimable."""
    names = list(cells["cell"])
    if study.sensitivity is not None:
        return names.index(f"{study.sensitivity.model}/{study.sensitivity.scheme}/gravity")
    return int(cells["estimable"].to_numpy(bool).argmax())


def figures_of(study: StudyConfig, cells: Sequence[Mapping[Any, Any]]) -> list[list[str]]:
    """Names of the figures that show a set-up.

    Parameters
    ----------
    study : StudyConfig
    cells : rows of the table `cells`

    Returns
    -------
    list of list of str, one for each cell
    """
    names = figure_names(study)
    tests = {name: test for name, test in _tests(study).items() if name in names}
    return [[name for name, test in tests.items() if test(cell)] for cell in cells]


def _tests(study: StudyConfig) -> dict[str, Callable[[Mapping[Any, Any]], bool]]:
    """Whether a figure shows a cell, by the figure's name; those nearest to one cell first."""
    settings = study.sensitivity
    paper = f"{settings.model}/{settings.scheme}/" if settings else ""
    presets = {f"{preset.model}/{preset.scheme}" for preset in PRESETS}
    tests: dict[str, Callable[[Mapping[Any, Any]], bool]] = {
        **dict.fromkeys(
            ("figure-7", "figure-8"),
            lambda cell: cell["cell"] == f"{paper}{cell['approach']}",
        ),
        "table-1": lambda cell: cell["cell"].rpartition("/")[0] in presets,
        "leveling-overview": lambda cell: True,
    }
    for factor in FACTORS:
        tests[f"sweep-{factor.name}"] = _drawn(study, factor)
    tests["closed-forms"] = lambda cell: bool(cell["n_converged"])
    tests["beyond-linear-theory"] = lambda cell: bool(is_compared(cell))
    return tests


def _drawn(study: StudyConfig, factor: Factor) -> Callable[[Mapping[Any, Any]], bool]:
    """Whether a cell is in the figure over a factor."""
    names = {name for block in blocks(study, factor) for name in block.cells["cell"]}
    return lambda cell: cell["cell"] in names


def library() -> str:
    """Return Vega-Embed, with all it needs, as vl-convert bundles it, gzipped, in base 64.

    To bundle it takes two seconds, so the text is kept for the next study.
    """
    return kept_or_made("explorer", f"vega-{version('vl-convert-python')}", _bundled, bytes.decode)


def _bundled() -> bytes:
    import vl_convert

    code = vl_convert.javascript_bundle("window.vegaEmbed = vegaEmbed;")
    return base64.b64encode(gzip.compress(code.encode(), mtime=0))
