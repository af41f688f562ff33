"""A small study without Snakemake: configured and simulated as the workflow does it."""

from accelstudy.basics.units import MGON
from accelstudy.files.tables import collect, read_table
from accelstudy.study.batches import batches, simulate_batch
from accelstudy.study.cells import study_cells
from accelstudy.study.config import parse_study
from accelstudy.study.replicates import Replicates, simulate
from accelstudy.study.statistics import statistics
from accelstudy.study.tables import TABLES

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


LEVELING = {"max_tilt_gon": 50, "attitudes": 200}


def simulated(cell, seed=1):
    """All replicates of a cell."""
    return simulate(cell, seed).simulated


def plain(cell, seed):
    """Statistics of a cell without linear theory."""
    return statistics(cell, Replicates(simulated(cell, seed), None), LEVELING)


def simulate_cells(folder, cells, seed=1, leveling=LEVELING):
    """Simulate a batch; the paths of the estimates and the tables."""
    paths = {name: folder / f"{name}.parquet" for name in ("estimates", *TABLES)}
    spec = {"seed": seed, "cells": [cell.to_dict() for cell in cells], "leveling": leveling}
    simulate_batch(spec, paths, PROVENANCE)
    return paths


def run_study(folder, batch_size=400_000, **keys):
    """Tables of a study, {name: DataFrame}, estimates included."""
    study = make_study(**keys)
    parts = [
        simulate_cells(folder / f"{i:04d}", cells, study.seed, study.leveling.model_dump())
        for i, cells in enumerate(batches(study_cells(study), batch_size))
    ]
    for name in TABLES:
        collect([part[name] for part in parts], folder / f"{name}.parquet", PROVENANCE)
    tables = {name: read_table(folder / f"{name}.parquet") for name in TABLES}
    return {**tables, "estimates": read_table([part["estimates"] for part in parts])}


def estimates_in(folder):
    """Files of estimates in the folder of `run_study`."""
    return sorted(folder.glob("*/estimates.parquet"))
