"""Peak memory and CPU time of each rule of a study over the replicates of a cell.

    python benchmarks/memory.py [replicates ...]

Runs each rule as a process of its own on one job's share of a cell, 10⁵ and 10⁶ replicates if none
are given: once with `keep: replicates` and once with `keep: summary`. The cell is the paper's, of 9
parameters and 24 positions. The table gives the largest resident memory, and the CPU time with that
of starting Python. The folder of temporary files (TMPDIR says which) needs 150 bytes per replicate.
"""

import json
import sys
import tempfile
from pathlib import Path

from accelstudy.study.config import read_study
from processes import took

CONFIG = Path(__file__).parents[1] / "config" / "config.yaml"
MODEL = "bias-scale-nonorthogonality"
TABLES = ("cells", "summary", "correlations", "leveling", "quantiles")
PROVENANCE = {"config_hash": "", "seed": 1}


def study_of(replicates, keep):
    """The study: the paper's two cells, all that its claims and figures need."""
    content = {
        **read_study(CONFIG).model_dump(mode="json", exclude_none=True),
        "grids": [
            {"models": [MODEL], "schemes": ["mclaren-24"], "replicates": int(replicates)},
        ],
        "keep": keep,
    }
    content.pop("presets")
    content["sensitivity"].update(base_samples=64, resamples=10, roll_gon=[0, 50], pitch_gon=[0])
    return content


def run(step, content, folder):
    """One rule, on files in a folder."""
    from accelstudy.files.tables import collect, read_table
    from accelstudy.study.batches import Share
    from accelstudy.study.cells import study_cells
    from accelstudy.study.claims.judging import TABLES as FOR_CLAIMS
    from accelstudy.study.claims.judging import judge_claims
    from accelstudy.study.config import parse_study
    from accelstudy.study.figures import figure_names, figure_tables, render
    from accelstudy.study.monte_carlo.simulate import simulate_batch
    from accelstudy.study.sensitivity import analyse_sensitivity, analyse_shapley
    from accelstudy.study.summary import summarise_batch

    study = parse_study(content)
    cells = study_cells(study)
    leveling = study.leveling.model_dump()
    kept = "estimates" if study.keep == "replicates" else "sketches"
    rule, _, part = step.partition(" ")
    names = {name: str(folder / part / f"{name}.parquet") for name in ("moments", kept)}
    if rule == "simulate":
        shares = [Share(c, 0, c.n_chunks).to_dict() for c in cells if c.approach == part]
        simulate_batch({"seed": 1, "shares": shares, "leveling": leveling}, names, PROVENANCE)
    elif rule == "summarise":
        spec = {"cells": [cell.to_dict() for cell in cells if cell.approach == part]}
        whole = folder / "whole" / part
        outputs = {name: whole / f"{name}.parquet" for name in (*TABLES, "moments", "sketches")}
        parts = {name: [path] for name, path in names.items()}
        summarise_batch(spec, parts, leveling, outputs, PROVENANCE)
    elif rule == "collect":
        for name in TABLES:
            parts = [folder / "whole" / cell.approach / f"{name}.parquet" for cell in cells]
            collect(parts, folder / f"{name}.parquet", PROVENANCE)
    elif rule == "sensitivity":
        summary, correlations, sensitivity, shapley = (
            folder / f"{name}.parquet"
            for name in ("summary", "correlations", "sensitivity", "shapley")
        )
        analyse_sensitivity(study, summary, sensitivity, PROVENANCE)
        analyse_shapley(study, summary, correlations, shapley, PROVENANCE)
    elif rule == "claims":
        parts = {
            name: [folder / "whole" / cell.approach / f"{name}.parquet" for cell in cells]
            for name in ("moments", "sketches")
        }
        if kept == "estimates":
            parts[kept] = [folder / cell.approach / "estimates.parquet" for cell in cells]
        outputs = {name: folder / f"{name}.parquet" for name in ("claims", "by_scheme", "html")}
        tables = {name: folder / f"{name}.parquet" for name in FOR_CLAIMS}
        judge_claims(study, parts, tables, outputs, PROVENANCE)
    else:
        for name in figure_names(study):
            tables = {key: read_table(folder / f"{key}.parquet") for key in figure_tables(name)}
            render(name, tables, study, folder / "figure.svg", folder / "figure.png")


STEPS = [
    *(f"{rule} {part}" for rule in ("simulate", "summarise") for part in ("gravity", "robot")),
    "collect",
    "sensitivity",
    "claims",
    "figures",
]


def main(sizes):
    """Print a row for each way to keep, number of replicates and rule."""
    print(f"{'keep':12}{'replicates':>12}  {'rule':20}{'CPU / s':>9}{'peak / MB':>11}")
    for keep in ("replicates", "summary"):
        for size in sizes:
            with tempfile.TemporaryDirectory() as name:
                content = json.dumps(study_of(size, keep))
                for step in STEPS:
                    _, cpu, peak = took(sys.executable, __file__, "--step", step, content, name)
                    row = f"{keep:12}{size:12.0e}  {step:20}{cpu:9.1f}{peak:11.0f}"
                    print(row, flush=True)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--step"]:
        run(sys.argv[2], json.loads(sys.argv[3]), Path(sys.argv[4]))
    else:
        main([float(text) for text in sys.argv[1:]] or [1e5, 1e6])
