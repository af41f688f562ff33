"""A small study without Snakemake: configured, simulated and summarised as the workflow does it."""

from accelstudy.adjustment.block import joined
from accelstudy.study.cells import batches, study_cells
from accelstudy.study.config import parse_study
from accelstudy.study.simulate import blocks, n_blocks, simulate_batch
from accelstudy.study.summary import summarise_batch
from accelstudy.study.tables import TABLES, collect, read_table
from accelstudy.units import MGON

NINE = "bias-scale-nonorthogonality"
PROVENANCE = {"config_hash": "0123456789abcdef", "seed": 1}

# Thalmann & Neuner (2018), section 4.
PAPER_SENSOR = {
    "bias": {"value": [0.05, 0.01, 0.03], "unit": "m/s^2"},
    "scale": {"value": 3 * [200], "unit": "ppm"},
    "nonorthogonality": {"value": [12, 12, 44], "unit": "mgon"},
}
PAPER_TRUTH = {
    **{"b_x": 0.05, "b_y": 0.01, "b_z": 0.03, "s_x": 200e-6, "s_y": 200e-6, "s_z": 200e-6},
    **{"alpha_yz": 12 * MGON, "alpha_zy": 12 * MGON, "alpha_zx": 44 * MGON},
}


def grid(models=NINE, schemes="mclaren-24", replicates=60, **more):
    return {"models": models, "schemes": schemes, "replicates": replicates, **more}


def content(**keys):
    """A valid configuration, as it is read from YAML."""
    return {"study": "tiny", "seed": 1, "sensor": PAPER_SENSOR, "grids": [grid()], **keys}


def make_study(**keys):
    return parse_study(content(**keys))


def make_cells(*grids, **keys):
    return {cell.name: cell for cell in study_cells(make_study(grids=list(grids), **keys))}


def specification(cells, seed=1):
    return {"seed": seed, "cells": [cell.to_dict() for cell in cells]}


def simulated(cell, seed=1):
    """All replicates of a cell in one block."""
    return joined(blocks(cell, seed, 0, n_blocks(cell)))


def simulate(folder, cells, seed=1):
    """Run the first stage; the paths of the estimates and of the correlations."""
    paths = folder / "estimates.parquet", folder / "correlations_adjustment.parquet"
    simulate_batch(specification(cells, seed), *paths, PROVENANCE)
    return paths


def run_study(folder, batch_size=100_000, **keys):
    """Run all stages up to the collected tables; {name: DataFrame}, estimates included."""
    study = make_study(**keys)
    parts = {name: [] for name in (*TABLES, "estimates")}
    for number, cells in enumerate(batches(study_cells(study), batch_size)):
        place = folder / f"{number:04d}"
        paths = {name: place / f"{name}.parquet" for name in TABLES}
        estimates, correlations = simulate(place, cells, study.seed)
        summarise_batch(
            specification(cells, study.seed),
            estimates,
            correlations,
            study.leveling.model_dump(),
            paths,
            PROVENANCE,
        )
        for name, path in {**paths, "estimates": estimates}.items():
            parts[name].append(path)
    for name in TABLES:
        collect(parts[name], folder / f"{name}.parquet", PROVENANCE)
    tables = {name: read_table(folder / f"{name}.parquet") for name in TABLES}
    return {**tables, "estimates": read_table(parts["estimates"])}
