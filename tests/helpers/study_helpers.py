"""A small study without Snakemake: configured, simulated and summarised as the workflow does it."""

from accelstudy.basics.units import MGON
from accelstudy.files.tables import collect, read_table
from accelstudy.study.batches import Share, batches
from accelstudy.study.cells import rare_cells, study_cells
from accelstudy.study.config import parse_study
from accelstudy.study.monte_carlo.replicates import Pair, blocks
from accelstudy.study.monte_carlo.simulate import simulate_batch
from accelstudy.study.rare import rare_table
from accelstudy.study.summary import summarise_batch
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
    """All replicates of a cell in one block."""
    return Pair.joined(blocks(cell, seed, 0, cell.n_blocks)).simulated


def simulate(folder, shares, seed=1, kept="estimates", leveling=LEVELING):
    """Run the first stage; the paths of what it wrote: `estimates`, or `sketches` instead."""
    paths = {name: folder / f"{name}.parquet" for name in ("moments", kept)}
    spec = {"seed": seed, "shares": [share.to_dict() for share in shares], "leveling": leveling}
    simulate_batch(spec, paths, PROVENANCE)
    return paths


def simulate_cells(folder, cells, seed=1):
    """Path of the estimates of whole cells."""
    return simulate(folder, [Share(cell, 0, cell.n_chunks) for cell in cells], seed)["estimates"]


def run_study(folder, batch_size=None, **keys):
    """Run all stages up to the collected tables.

    Returns
    -------
    tables : {name: DataFrame}, estimates included, if they are kept
    """
    study = make_study(**keys)
    leveling = study.leveling.model_dump()
    wholes = {name: [] for name in (*TABLES, "sketches")}
    estimates = []
    for number, batch in enumerate(batches(study_cells(study), batch_size)):
        place = folder / f"{number:04d}"
        parts = [
            simulate(
                place / f"{i:04d}",
                job,
                study.seed,
                "estimates" if study.keep == "replicates" else "sketches",
                leveling,
            )
            for i, job in enumerate(batch.jobs)
        ]
        paths = {name: place / f"{name}.parquet" for name in wholes}
        summarise_batch(
            {"cells": [cell.to_dict() for cell in batch.cells]},
            {name: [part[name] for part in parts] for name in parts[0]},
            leveling,
            paths,
            PROVENANCE,
        )
        estimates += [part["estimates"] for part in parts if "estimates" in part]
        for name, path in paths.items():
            wholes[name].append(path)
    for name in TABLES:
        collect(wholes[name], folder / f"{name}.parquet", PROVENANCE)
    tables = {name: read_table(folder / f"{name}.parquet") for name in TABLES}
    return {**tables, **({"estimates": read_table(estimates)} if estimates else {})}


def run_rare(folder, study):
    """The table of rare tilt errors."""
    cells = [cell.to_dict() for cell in rare_cells(study, study_cells(study))]
    spec = {"seed": study.seed, "cells": cells, "leveling": study.leveling.model_dump()}
    rare_table({**spec, "shares": study.rare.shares}, folder / "rare.parquet", PROVENANCE)
    return read_table(folder / "rare.parquet")


def parts_in(folder):
    """What the claims take from the folder of `run_study`."""
    names = {"moments": "*/*/moments.parquet", "sketches": "*/sketches.parquet"}
    names["estimates"] = "*/*/estimates.parquet"
    return {name: sorted(folder.glob(pattern)) for name, pattern in names.items()}
