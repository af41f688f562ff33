from functools import cache
from pathlib import Path

from snakemake.sourcecache import LocalSourceFile

from accelstudy.study.figures import captions, figure_names, figure_tables, get_figure
from accelstudy.study.batches import batches, memory
from accelstudy.study.cells import study_cells
from accelstudy.study.config import parse_study
from accelstudy.jobs.job import setup_digest
from accelstudy.study.tables import TABLES

STUDY, RESULTS = configured(parse_study, "study")
STUDY = STUDY.model_copy(update={"angle_unit": STUDY.angle_unit or angle_unit()})
with in_a_line():
    CELLS = study_cells(STUDY)

# Jobs get the checked configuration, with all defaults.
config.update(STUDY.model_dump(mode="json"))

# A job simulates a batch of cells, because starting Python takes longer than a small cell.
BATCHES = {f"{i:04d}": cells for i, cells in enumerate(batches(CELLS))}
BATCH = f"{RESULTS}/batches/{{batch}}"
ESTIMATES = f"{RESULTS}/estimates/{{batch}}.parquet"
FIGURES = figure_names(STUDY)
# What figures and explorer take from the configuration; all else reaches them by the tables.
SHOWN = {"angle_unit", "gravity_mps2", "grids", "leveling", "models", "noise", "presets"}
SHOWN |= {"schemes", "sensitivity"}
DRAWN = STUDY.model_dump(mode="json", include=SHOWN)
CELL_FIGURES = [name for name in FIGURES if set(figure_tables(name)) <= {*TABLES}]
SENSITIVITY_FIGURES = [name for name in FIGURES if name not in CELL_FIGURES]
FINAL_TABLES = [
    *TABLES,
    *(["sensitivity", "shapley"] if STUDY.sensitivity else []),
    *(["claims", "claims_by_scheme"] if STUDY.paper else []),
]


wildcard_constraints:
    batch=r"\d+",


@cache
def batch_spec(batch):
    """Everything that the numbers of a batch depend on, as plain data."""
    cells = [cell.to_dict() for cell in BATCHES[batch]]
    return {"seed": STUDY.seed, "cells": cells, "leveling": STUDY.leveling.model_dump()}


def batches_of_claims():
    """Batches with the cells that the sensitivity analysis and the claims use."""
    model = STUDY.sensitivity.model
    return [b for b, cells in BATCHES.items() if any(cell.model == model for cell in cells)]


def in_report(name):
    """A figure as the report shows it."""
    entry = get_figure(name)
    return report(
        f"{RESULTS}/figures/{name}.svg",
        category=entry.category,
        labels={"content": entry.title},
    )


def give_captions(rule):
    """Give each figure in the report the caption that its job writes beside it.

    As an argument of `report`, Snakemake would look for it where the rules are, such as on GitHub.
    """
    for figure in rule.output:
        if "report" in figure.flags:
            caption = LocalSourceFile(os.path.abspath(Path(figure).with_suffix(".rst")))
            figure.flags["report"] = figure.flags["report"]._replace(caption=caption)


def files_of_figures(names):
    """All files of figures."""
    others = [f"{RESULTS}/figures/{name}.{kind}" for name in names for kind in ("png", "rst")]
    return [*map(in_report, names), *others]


def inputs_of_figures(names):
    """Tables that figures need."""
    return {table: f"{RESULTS}/{table}.parquet" for table in figure_tables(*names)}
