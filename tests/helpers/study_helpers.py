"""A small study without Snakemake: configured and simulated as the workflow does it."""

from accelstudy.files.tables import read_table, write_table
from accelstudy.study import tables as of_cells
from accelstudy.study.cell import fanned_out
from accelstudy.study.config import parse_study
from accelstudy.study.replicates import simulate
from accelstudy.study.statistics import statistics
from accelstudy.study.tables import TABLES, collect

NINE = "bias-scale-nonorthogonality"
PROVENANCE = {"config_hash": "0123456789abcdef", "seed": 1}

# Thalmann & Neuner (2018), section 4.
PAPER_SENSOR = {
    "bias": {"value": [0.05, 0.01, 0.03], "unit": "m/s^2"},
    "scale": {"value": 3 * [200], "unit": "ppm"},
    "nonorthogonality": {"value": [12, 12, 44], "unit": "mgon"},
}


def grid(models=NINE, schemes="mclaren-24", replicates=60, **more):
    return {"models": models, "schemes": schemes, "replicates": replicates, **more}


def content(**keys):
    """A valid configuration, as it is read from YAML."""
    return {"study": "tiny", "seed": 1, "sensor": PAPER_SENSOR, "grids": [grid()], **keys}


def make_study(**keys):
    return parse_study(content(**keys))


def make_cells(*grids, **keys):
    return {cell.name: cell for cell in make_study(grids=list(grids), **keys).cells}


def simulated(cell, seed=1):
    """The calibrations of a small cell."""
    (block,) = simulate(cell, seed).simulated
    return block


def plain(cell, seed):
    """Statistics of a cell without linear theory."""
    return statistics(cell, simulate(cell, seed)._replace(linear=[]))


def simulate_cells(folder, cells, seed=1):
    """Simulate cells as a job; the paths of the estimates and the tables."""
    paths = {name: folder / f"{name}.parquet" for name in ("estimates", *TABLES)}
    of_cells.simulate_cells([*cells], paths, {**PROVENANCE, "seed": seed})
    return paths


def run_study(folder, pattern="{model}", **keys):
    """Tables of a study, {name: DataFrame}, estimates included; `pattern` names the jobs."""
    study = make_study(**keys)
    cells = study.cells
    parts = [
        simulate_cells(folder / name, each, study.seed)
        for name, each in fanned_out(cells, pattern).items()
    ]
    names = [cell.name for cell in cells]
    tables = {
        name: collect([part[name] for part in parts], names) for name in (*TABLES, "estimates")
    }
    for name in TABLES:
        write_table(folder / f"{name}.parquet", tables[name], PROVENANCE)
        tables[name] = read_table(folder / f"{name}.parquet")
    return tables
