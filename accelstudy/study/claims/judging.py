"""The claims judged by the files of a study: verdicts as tables, as a page and as Markdown."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from accelstudy.basics.wording import interval, number
from accelstudy.files.outputs import whole_file
from accelstudy.files.tables import read_table, write_table
from accelstudy.study.cell import Cell
from accelstudy.study.cells import study_cells
from accelstudy.study.claims.base import Array, Evidence, judge, schemes_with_both
from accelstudy.study.config import StudyConfig
from accelstudy.study.monte_carlo.distributions import (
    EXACT,
    Distribution,
    Sample,
    kept_sketches,
    kept_values,
)
from accelstudy.study.monte_carlo.followed import EFFECT
from accelstudy.study.monte_carlo.sketch import Sketch
from accelstudy.study.monte_carlo.statistics import Statistics, read_statistics

SWEEP = "config/sweeps/positions.yaml"
"""A study for readers of the claims who want one of their own."""


def judge_claims(
    study: StudyConfig,
    parts: Mapping[str, Sequence[str | Path]],
    correlations: str | Path,
    sensitivity: str | Path,
    shapley: str | Path,
    outputs: Mapping[str, str],
    provenance: Mapping[str, Any],
) -> None:
    """Judge the paper's claims.

    Parameters
    ----------
    study : StudyConfig, with `sensitivity`
    parts : see `evidence_from`
    correlations, sensitivity, shapley : paths of the tables
    outputs : paths of `claims`, `by_scheme` and `html`
    provenance : see `accelstudy.files.tables.origin`
    """
    settings = study.sensitivity
    assert settings is not None
    cells = [
        cell
        for cell in study_cells(study)
        if cell.name == "/".join([settings.model, cell.scheme, cell.approach])
    ]
    evidence = evidence_from(
        cells,
        parts,
        scheme=settings.scheme,
        correlations=read_table(correlations),
        sensitivity=read_table(sensitivity),
        shapley=read_table(shapley),
        base_samples=settings.base_samples,
        resamples=settings.resamples,
        seed=study.seed,
    )
    claims, by_scheme = judge(evidence)
    write_table(outputs["claims"], claims, provenance)
    write_table(outputs["by_scheme"], by_scheme, provenance)
    with whole_file(outputs["html"]) as path:
        path.write_text(claims_page(claims, by_scheme), encoding="utf-8")


def evidence_from(
    cells: Iterable[Cell], parts: Mapping[str, Sequence[str | Path]], **rest: Any
) -> Evidence:
    """Collect the evidence.

    Parameters
    ----------
    cells : cells with the model of the claims
    parts : paths of `moments`, `sketches` and, where they are kept, `estimates` of these cells
    **rest : as in `Evidence`
    """
    by_name = {cell.name: cell for cell in cells}
    merged = read_statistics(parts["moments"], by_name.values())
    by_key = {(by_name[name].scheme, by_name[name].approach): by_name[name] for name in merged}
    statistics = {key: merged[cell.name][0] for key, cell in by_key.items()}
    ratios: dict[tuple[str, str], Distribution] = {}
    for scheme in schemes_with_both(by_key):
        pair = [(by_key[scheme, a], statistics[scheme, a]) for a in ("gravity", "robot")]
        if all(summed.moments.redundancy > 0 and summed.converged for _, summed in pair):
            for effect, ratio in _ratios(pair, parts).items():
                ratios[scheme, effect] = ratio
    return Evidence(statistics=statistics, ratios=ratios, cells=by_key, **rest)


def _ratios(
    pair: Sequence[tuple[Cell, Statistics]], parts: Mapping[str, Sequence[str | Path]]
) -> dict[str, Distribution]:
    """Ratios by effect, robot-aided over gravity-based, of independent sessions.

    Kept calibrations are paired by their number; with sketches, each is paired with each.
    """
    keys = [(EFFECT, effect) for effect in pair[0][1].followed.effects]
    if parts.get("estimates") and all(summed.converged <= EXACT for _, summed in pair):
        gravity, robot = (
            kept_values(parts["estimates"], cell, summed.converged, keys) for cell, summed in pair
        )
        n = min(gravity.shape[1], robot.shape[1])
        values = robot[:, :n] / gravity[:, :n]
        return {effect: Sample(row) for (_, effect), row in zip(keys, values, strict=True)}
    gravity_sketches, robot_sketches = (kept_sketches(parts["sketches"], cell) for cell, _ in pair)
    return {key[1]: RatioOfSketches(robot_sketches[key], gravity_sketches[key]) for key in keys}


class RatioOfSketches:
    """Ratio of two independent quantities that have sketches; within 0.2 %."""

    def __init__(self, above: Sketch, below: Sketch) -> None:
        self.above = above
        self.below, counts = below.occupied()
        self.weights = counts / counts.sum()
        above_values, _ = above.occupied()
        self.ends = (
            above_values.min() / self.below.max() / 2,
            above_values.max() / self.below.min() * 2,
        )

    def share_below(self, values: ArrayLike) -> Array:
        """Shares that are below given values."""
        limits = np.multiply.outer(np.asarray(values, dtype=float), self.below)
        return self.above.share_below(limits) @ self.weights

    def quantile(self, probabilities: ArrayLike) -> Array:
        """Quantiles."""
        from scipy import optimize  # slow to import, and studies that keep replicates do without

        return np.array(
            [
                optimize.brentq(lambda x, p=p: self.share_below(x) - p, *self.ends, rtol=1e-9)
                for p in np.atleast_1d(probabilities)
            ]
        )


def claims_page(claims: pd.DataFrame, by_scheme: pd.DataFrame) -> str:
    """Page (HTML, self-contained) with all claims and their verdicts."""
    from accelstudy.pages import render  # which shows numbers as here

    return render(
        "study/claims/page.html.j2",
        claims=claims.to_dict("records"),
        schemes=by_scheme.to_dict("records"),
        next_steps=[
            ("See what another study would run", f"accelstudy cells config/config.yaml {SWEEP}"),
            ("Run it", f"snakemake --cores 2 --configfile {SWEEP}"),
        ],
    )


def claims_markdown(claims: pd.DataFrame) -> str:
    """The claims as a table in Markdown, one row each."""
    lines = [
        "| section | claim | paper | ours (95 % interval) | verdict | |",
        "|---|---|---|---|---|---|",
    ]
    for row in claims.to_dict("records"):
        unit = "" if row["unit"] in ("1", "ratio") else f" {row['unit']}"
        paper = "–" if math.isnan(row["paper"]) else f"{number(row['paper'])}{unit}"
        ours = f"{number(row['ours'])}{unit}"
        spread = interval(row["ci95_low"], row["ci95_high"])
        ours += f" ({spread})" if spread else ""
        lines.append(
            f"| {row['section']} | {row['statement']} | {paper} | {ours} | "
            f"**{row['verdict']}** | {row['sentence']} |"
        )
    return "\n".join(lines) + "\n"
