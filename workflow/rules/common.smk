from pathlib import Path

from snakemake.exceptions import WorkflowError

from accelstudy.errors import InputError
from accelstudy.figures import angle_unit, caption, figure_names, figure_tables, get_figure
from accelstudy.study.cells import batches, study_cells
from accelstudy.study.config import parse_study, read_layer
from accelstudy.study.effort import study_effort
from accelstudy.study.provenance import check_writable, code_hash
from accelstudy.study.tables import TABLES

try:
    for path in workflow.configfiles:
        read_layer(path)  # more strictly than Snakemake does
    STUDY = parse_study(config, ", ".join(map(str, workflow.configfiles)) or "config")
    RESULTS = f"results/{STUDY.study}"
    check_writable(RESULTS)
    angle_unit(STUDY)
    CELLS = study_cells(STUDY)
    EFFORT = study_effort(STUDY, CELLS)
except InputError as error:
    raise WorkflowError(str(error)) from None

# Cells run in batches, so that starting Python does not dominate; a batch is a job.
BATCHES = {f"{i:04d}": cells for i, cells in enumerate(batches(CELLS))}
PARTS = f"{RESULTS}/batches/{{batch}}"
CAPTIONS = Path(str(workflow.current_basedir)).parent / "report/figures"
ANALYSES = ["forces", "gravity", "robot"]
FINAL_TABLES = [
    *TABLES,
    *(["sensitivity"] if STUDY.sensitivity else []),
    *(["claims", "claims_by_scheme"] if STUDY.paper else []),
]


wildcard_constraints:
    batch=r"\d{4}",
    analysis="|".join(ANALYSES),


def batch_spec(wildcards):
    """All on which the numbers of a batch depend, as plain data."""
    return {"seed": STUDY.seed, "cells": [cell.to_dict() for cell in BATCHES[wildcards.batch]]}


def estimates_of(choose):
    """Files that hold the estimates of the chosen cells."""
    return [
        f"{RESULTS}/estimates/{batch}.parquet"
        for batch, cells in BATCHES.items()
        if any(map(choose, cells))
    ]


def figure_caption(wildcards):
    """Text below the figure in the report."""
    name = wildcards.figure
    text = (CAPTIONS / f"{get_figure(name).caption}.rst").read_text(encoding="utf-8")
    return caption(name, text, STUDY)


def figure_inputs(wildcards):
    """Tables that a figure needs; of the estimates only the files with the paper's two cells."""
    inputs = {}
    for table in figure_tables(wildcards.figure):
        if table == "estimates":
            inputs[table] = estimates_of(
                lambda cell: (cell.model, cell.scheme)
                == (STUDY.sensitivity.model, STUDY.sensitivity.scheme)
            )
        else:
            inputs[table] = f"{RESULTS}/{table}.parquet"
    return inputs
