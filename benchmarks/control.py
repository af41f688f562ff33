"""Whether controlled estimates are right: against plain averages, and with other seeds.

    python benchmarks/control.py            # some hours of one core
    python benchmarks/control.py --quick    # minutes

It prints rms of z, share below 1.96 and median gain; docs/theory/control-variates.md sums up.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from accelstudy.study.cell import Cell
from accelstudy.study.config import read_study
from accelstudy.study.replicates import simulate
from accelstudy.study.statistics import statistics
from accelstudy.study.tables import tables_of

CONFIG = Path(__file__).parent.parent / "config" / "config.yaml"
NOISES = (0.002, 0.02, 0.1, 0.3)
FAILING = (1.0,)
ATTITUDES = 50


def cells_of(noises: Sequence[float], where: Sequence[str] = ()) -> list[Cell]:
    """Estimable cells of the paper's study with the noise of forces and angles scaled."""
    study = read_study(CONFIG)
    chosen = []
    for cell in study.cells:
        if (where and cell.name not in where) or not cell.estimability.estimable:
            continue
        for noise in noises:
            factor = noise / cell.noise.sigma_force
            scaled = replace(
                cell.noise, sigma_force=noise, sigma_angle=factor * cell.noise.sigma_angle
            )
            name = f"{cell.name}/{noise:g}"
            chosen.append(
                replace(cell, name=name, noise=scaled, compiled=False, attitudes=ATTITUDES)
            )
    return chosen


def estimates(
    cell: Cell, replicates: int, seed: int, compiled: bool = False, plain: bool = False
) -> pd.DataFrame:
    """All estimates of a cell with their standard errors, as a study tabulates them."""
    cell = replace(cell, replicates=replicates, compiled=compiled)
    made = simulate(cell, seed)
    tables = tables_of([statistics(cell, made._replace(linear=[]) if plain else made)])
    return pd.concat(_rows(tables), ignore_index=True).assign(cell=cell.name)


def _rows(tables: dict[str, pd.DataFrame]) -> Iterator[pd.DataFrame]:
    """Each kind of estimate as rows of kind, name, value, error, gain and plain average."""
    summary = tables["summary"]
    share = summary["n_converged"] / summary["n_replicates"]
    for kind, value, short in (("bias", "bias", "bias"), ("sd", "sd_empirical", "sd")):
        yield _table(kind, summary["parameter"], summary, value, short).assign(converged=share)
    for kind, value, short in (
        ("sd a posteriori", "sd_posteriori_mean", "sd_posteriori"),
        ("coverage", "coverage_95", "coverage_95"),
    ):
        yield _table(kind, summary["parameter"], summary, value, short)
    pairs = tables["correlations"]
    pairs = pairs[pairs["parameter_1"].astype(str) < pairs["parameter_2"].astype(str)]
    names = pairs["parameter_1"].astype(str) + " " + pairs["parameter_2"].astype(str)
    yield _table("correlation", names, pairs, "empirical", "empirical")
    yield _table("variance factor", ["-"], tables["cells"], "variance_factor", "variance_factor")
    for angle in ("roll", "pitch"):
        rms = f"{angle}_rms"
        yield _table("tilt rms", [angle], tables["leveling"], f"{rms}_mgon", rms)
    quantiles = tables["quantiles"]
    quantiles = quantiles[quantiles["probability"].isin([0.025, 0.25, 0.5, 0.75, 0.95, 0.975])]
    for quantity, rows in quantiles.groupby("quantity", sort=False):
        names = rows["name"].astype(str) + " " + rows["probability"].astype(str)
        kind = {"tilt": "tilt bound", "error": "quantile of an error"}
        yield _table(kind.get(str(quantity), "quantile of an sd"), names, rows, "value", "value")


def _table(
    kind: str, names: Iterable[str], rows: pd.DataFrame, value: str, short: str
) -> pd.DataFrame:
    plain = rows.get(f"{short}_plain")
    return pd.DataFrame(
        {
            "kind": kind,
            "name": [*names],
            "value": rows[value].to_numpy(float),
            "error": rows[f"{short}_se"].to_numpy(float),
            "gain": rows[f"{short}_gain"].to_numpy(float),
            "plain": np.nan if plain is None else plain.to_numpy(float),
        }
    )


def against_plain(cell: Cell, plain: int, controlled: int = 1000) -> pd.DataFrame:
    """z of controlled estimates against plain averages of many replicates of another seed."""
    many = estimates(cell, plain, 2, plain > 100_000, plain=True)
    few = estimates(cell, controlled, 1)
    both = few.merge(many, on=["cell", "kind", "name"], suffixes=("", "_many"))
    both["z"] = (both["value"] - both["value_many"]) / np.hypot(both["error"], both["error_many"])
    return both


def coverage(cell: Cell, seeds: int, controlled: int, many: int) -> pd.DataFrame:
    """z of controlled estimates of many seeds against that of very many replicates."""
    truth = estimates(cell, many, 10_000, many > 100_000)[["kind", "name", "value", "error"]]
    found = pd.concat([estimates(cell, controlled, seed) for seed in range(seeds)])
    both = found.merge(truth, on=["kind", "name"], suffixes=("", "_many"))
    both["z"] = (both["value"] - both["value_many"]) / np.hypot(both["error"], both["error_many"])
    return both


def shown(rows: pd.DataFrame) -> str:
    """Rms of the z-scores, and their share below 1.96, by kind and noise, as Markdown."""
    rows = rows[np.isfinite(rows["z"])]
    noises = sorted(rows["noise"].unique())
    lines = ["| estimate | n | " + " | ".join(f"{1e3 * x:g} mm/s²" for x in noises) + " |"]
    lines.append("|" + "---|" * (2 + len(noises)))
    for kind, group in rows.groupby("kind", sort=False):
        cells = [str(kind), str(len(group))]
        for noise in noises:
            z, gain = (group.loc[group["noise"] == noise, name] for name in ("z", "gain"))
            inside = f"{100 * np.mean(np.abs(z) < 1.96):.0f} %"
            cells.append(f"{np.sqrt(np.mean(z**2)):.2f}, {inside}, {gain.median():.2g}")
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def stages(quick: bool) -> dict[str, tuple[Callable[[Cell], pd.DataFrame], list[Cell]]]:
    """Title of each stage, and what is done of which cells."""
    of_figures = [
        f"bias-scale-nonorthogonality/mclaren-24/{approach}" for approach in ("gravity", "robot")
    ]
    some, many, seeds = (2000, 10**5, 20) if quick else (10_000, 10**6, 200)
    return {
        "failing": (partial(against_plain, plain=many), cells_of(FAILING, of_figures)),
        "coverage": (
            partial(coverage, seeds=seeds, controlled=1000, many=many),
            cells_of((*NOISES, *FAILING), of_figures),
        ),
        "all": (partial(against_plain, plain=some), cells_of(NOISES)),
    }


def main() -> None:
    """Print all tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("only", nargs="*", help="stages; all if none is named")
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--cores", type=int, default=1)
    parser.add_argument("--out", type=Path, help="folder for the z-scores, as Parquet")
    options = parser.parse_args()
    with ProcessPoolExecutor(options.cores) as pool:
        for title, (task, cells) in stages(options.quick).items():
            if options.only and title not in options.only:
                continue
            rows = pd.concat(pool.map(task, cells), ignore_index=True)
            rows["noise"] = rows["cell"].str.rsplit("/", n=1).str[1].astype(float)
            if options.out:
                options.out.mkdir(parents=True, exist_ok=True)
                rows.to_parquet(options.out / f"{title}.parquet")
            print(f"\n## {title}\n\n{shown(rows)}")
            sys.stdout.flush()


if __name__ == "__main__":
    main()
