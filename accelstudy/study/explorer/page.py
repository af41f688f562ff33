"""The page of an explorer: everything in one file, at most `LIMIT` bytes of it."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from accelstudy.basics.units import angles_in, display_unit, unit_label
from accelstudy.basics.wording import comma_list, counted
from accelstudy.drawing.style import approach_colour, approach_marker
from accelstudy.files.outputs import whole_file
from accelstudy.files.tables import read_table
from accelstudy.pages import render
from accelstudy.study.config import StudyConfig
from accelstudy.study.explorer import charts
from accelstudy.study.explorer.content import (
    ANGLES,
    correlations,
    fitting,
    levels,
    number,
    parameters,
    setups,
    varied,
    without_robot,
)
from accelstudy.study.explorer.library import library
from accelstudy.study.explorer.links import figures_of
from accelstudy.study.figures import angle_unit, figure_names, get_figure
from accelstudy.study.figures.factors import FACTORS, NOISES, POSITIONS, Factor, varies
from accelstudy.study.tables import TABLES

LIMIT = 1_500_000
"""Bytes of the page."""
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
    heads, rows = setups(cells, tables, figures_of(study, cells.to_dict("records")))
    more, details = parameters(cells, tables)
    content = {
        **heads,
        **more,
        "angle": display_unit("rad"),
        "factors": [factor.name for factor in factors],
        "titles": {factor.name: factor.title for factor in factors},
        "noises": {factor.name: _unit(factor) for factor in factors},
        "start": _start(study, cells),
        "report": dict(in_report),
        "look": charts.look(),
        "charts": charts.all_charts(heads["approaches"]),
    }
    shown = {
        "study": study.study,
        "counts": _counts(cells),
        "fixed": _fixed(cells),
        "controls": _controls(cells, heads),
        "by": _first_rows(study, heads),
        "columns": _columns(factors, heads["groups"]),
        "quantities": PARAMETER_COLUMNS,
        "texts": ("model", "scheme", "approach", "state", "parameter", "unit"),
        "unit": display_unit("rad"),
        "units": more["units"],
        "approaches": [
            {"name": name, "colour": approach_colour(name), "path": PATHS[approach_marker(name)]}
            for name in heads["approaches"]
        ],
        "figures": [
            {"name": name, "title": get_figure(name).title} for name in figure_names(study)
        ],
        "tables": comma_list([f"{name}.parquet" for name in TABLES]),
        "library": library(),
    }

    def page(left_out: Sequence[str], **lists: Sequence[str]) -> str:
        text = json.dumps(content, ensure_ascii=False, separators=(",", ":"))
        text = text[:-1] + "".join(f',"{name}":[{",".join(its)}]' for name, its in lists.items())
        # No text of the data can end the element that it stands in.
        data = f"{text}}}".replace("<", "\\u003c")
        return render(TEMPLATE, **shown, left_out=left_out, content=data)

    room = LIMIT - len(page([500 * "x"], rows=[], details=[]).encode())
    matrices = correlations(cells, tables["correlations"])
    both = (f"[{its},{matrix}]" for its, matrix in zip(details, matrices, strict=True))
    kept_rows, room = fitting(rows, room)
    kept_details, _ = fitting(both if len(kept_rows) == len(cells) else (), room)
    left_out = _left_out(cells, len(kept_rows), len(kept_details))
    return page(left_out, rows=kept_rows, details=kept_details)


def _left_out(cells: pd.DataFrame, rows: int, details: int) -> list[str]:
    """Say what has no room on the page."""
    end = f"A page has at most {LIMIT / 1e6:g} MB"
    if rows < len(cells):
        missing = cells[rows:]
        blind = int((~missing["estimable"]).sum())
        return [
            f"{end}, so only the first {rows} of {len(cells)} set-ups are here, without their "
            f"parameters and correlations. The other {len(missing)} ({blind} of them not "
            "estimable) are in the tables."
        ]
    if details < len(cells):
        return [
            f"{end}, so the parameters and correlations of only the first {details} of "
            f"{len(cells)} set-ups are here. Those of the others are in the tables."
        ]
    return []


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
    said = f"{counted(len(cells), 'set-up')} with {calibrations} simulated calibrations"
    return f"{said}; of the set-ups, {comma_list(failed)}." if failed else f"{said}."


def _fixed(cells: pd.DataFrame) -> str:
    """Say which noise is the same in all set-ups."""
    parts = []
    for factor in NOISES:
        values = levels(cells, factor)
        values = values[~np.isnan(values)]
        if len(values) and len(np.unique(values)) == 1 and values[0] != 0:
            parts.append(f"{factor.title} {values[0]:.4g} {_unit(factor)}")
    return comma_list(parts)


def _controls(cells: pd.DataFrame, heads: Mapping[str, Any]) -> list[dict[str, Any]]:
    """What can be chosen: a title and options, each with its value and text."""
    controls: list[dict[str, Any]] = [
        {"key": key, "title": key, "options": list(enumerate(options))}
        for key, options in (
            ("model", [model["title"] for model in heads["models"]]),
            ("scheme", [scheme["title"] for scheme in heads["schemes"]]),
            ("approach", heads["approaches"]),
        )
    ]
    for factor, key in ((POSITIONS, "n"), *((its, its.name) for its in varied(cells))):
        values = np.unique(levels(cells, factor))
        options = [(number(value), f"{value:.4g}") for value in values[~np.isnan(values)]]
        controls.append(
            {"key": key, "title": factor.title, "unit": _unit(factor), "options": options}
        )
    return controls


def _first_rows(study: StudyConfig, heads: Mapping[str, Any]) -> str:
    """What the rows of the chart are at first: what the study varies."""
    swept = [factor for factor in FACTORS if varies(study, factor)]
    if swept:
        return "n" if swept[0] is POSITIONS else swept[0].name
    return "scheme" if len(heads["schemes"]) > 1 else "model"


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
