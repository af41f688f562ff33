"""The claims judged by the files of a study: verdicts as tables, as a page and as Markdown."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from accelstudy.basics.wording import interval, number
from accelstudy.files.outputs import whole_file
from accelstudy.files.tables import read_table, write_table
from accelstudy.study.beyond_linear_theory import beyond_linear_theory, knows_all
from accelstudy.study.cell import Cell
from accelstudy.study.cells import study_cells
from accelstudy.study.claims.base import Array, Evidence, judge, schemes_with_both
from accelstudy.study.config import StudyConfig
from accelstudy.study.monte_carlo.control import Control
from accelstudy.study.monte_carlo.distributions import (
    EXACT,
    Controlled,
    Sample,
    kept_pairs,
    kept_sketches,
)
from accelstudy.study.monte_carlo.followed import EFFECT, cell_tilt_error
from accelstudy.study.monte_carlo.moments import EDGES, PROBABILITIES, apart_by_quantile
from accelstudy.study.monte_carlo.sketch import Sketch
from accelstudy.study.monte_carlo.statistics import Statistics, read_trees

TABLES = ("cells", "summary", "correlations", "sensitivity", "shapley")
"""What the claims are judged by, beside moments, sketches and estimates."""
SWEEP = "config/sweeps/positions.yaml"
"""A study for readers of the claims who want one of their own."""


def judge_claims(
    study: StudyConfig,
    parts: Mapping[str, Sequence[str | Path]],
    tables: Mapping[str, str | Path],
    outputs: Mapping[str, str],
    provenance: Mapping[str, Any],
) -> None:
    """Judge the paper's claims, and those of this project.

    Parameters
    ----------
    study : StudyConfig, with `sensitivity`
    parts : see `evidence_from`
    tables : paths of the tables of `TABLES`, by their names
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
    read = {name: read_table(tables[name]) for name in TABLES}
    known = knows_all(study)
    beyond = beyond_linear_theory(read["cells"], read["summary"]) if known else None
    evidence = evidence_from(
        cells,
        parts,
        study.leveling.model_dump(),
        scheme=settings.scheme,
        correlations=read["correlations"],
        sensitivity=read["sensitivity"],
        shapley=read["shapley"],
        beyond=beyond,
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
    cells: Iterable[Cell],
    parts: Mapping[str, Sequence[str | Path]],
    leveling: Mapping[str, Any],
    **rest: Any,
) -> Evidence:
    """Collect the evidence.

    Parameters
    ----------
    cells : cells with the model of the claims
    parts : paths of `moments`, `sketches` and, where they are kept, `estimates` of these cells
    leveling : mapping with max_tilt_gon and attitudes
    **rest : as in `Evidence`
    """
    by_name = {cell.name: cell for cell in cells}
    found = {}
    for name, tree in read_trees(parts["moments"], by_name).items():
        cell = by_name[name]
        tilt = cell_tilt_error(cell, leveling)
        control = Control.of(cell, tilt)
        statistics = Statistics.of(cell, tree, control, tilt)
        found[cell.scheme, cell.approach] = _Calibrations(cell, statistics, control)
    ratios: dict[tuple[str, str], Controlled] = {}
    for scheme in schemes_with_both(found):
        pair = found[scheme, "gravity"], found[scheme, "robot"]
        if all(each.statistics.moments.redundancy > 0 and each.number for each in pair):
            for effect in pair[0].statistics.followed.effects:
                ratios[scheme, effect] = _ratio(*pair, effect, parts)
    return Evidence(
        statistics={key: each.statistics for key, each in found.items()},
        ratios=ratios,
        cells={key: each.cell for key, each in found.items()},
        **rest,
    )


class _Calibrations(NamedTuple):
    """The calibrations of a cell."""

    cell: Cell
    statistics: Statistics
    control: Control | None

    @property
    def number(self) -> int:
        """Number of those that converged."""
        return self.statistics.converged


def _ratio(
    gravity: _Calibrations,
    robot: _Calibrations,
    effect: str,
    parts: Mapping[str, Sequence[str | Path]],
) -> Controlled:
    """Ratio of the sigma of an effect, robot-aided over gravity-based, of independent sessions.

    Kept calibrations are paired by their number; with sketches, each is paired with each.
    """
    n = min(gravity.number, robot.number)
    if not parts.get("estimates") or max(gravity.number, robot.number) > EXACT:
        sketches = [kept_sketches(parts["sketches"], each.cell) for each in (robot, gravity)]
        return Controlled(RatioOfSketches(*(each[EFFECT, effect] for each in sketches)), n)
    above, linear_above = _kept(robot, effect, parts["estimates"])
    below, linear_below = _kept(gravity, effect, parts["estimates"])
    ratio = above[:n] / below[:n]
    numerator, denominator = robot.control, gravity.control
    if numerator is None or denominator is None:
        return Controlled(Sample(ratio), n)
    linear = linear_above[:n] / linear_below[:n]

    def known(probabilities: Array) -> Array:
        return numerator.ratio_quantiles(denominator, effect, probabilities)

    apart = apart_by_quantile(ratio - linear, linear, known(EDGES))
    return Controlled(
        Sample(ratio), n, linear=Sample(linear), known=known(PROBABILITIES), apart=apart
    )


def _kept(of: _Calibrations, effect: str, estimates: Sequence[str | Path]) -> tuple[Array, Array]:
    """Sigma of an effect in the kept calibrations that converged, and by linear theory."""
    followed, values = of.statistics.followed, []
    column = followed.keys.index((EFFECT, effect))
    for simulated, linear in kept_pairs(estimates, of.cell, of.control):
        own = followed.values(simulated)[:, column]
        theory = own if linear is None else followed.values(linear)[simulated.converged, column]
        values.append((own, theory))
    own, theory = zip(*values, strict=True)
    return np.concatenate(own), np.concatenate(theory)


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

        wanted = np.asarray(probabilities, dtype=float)
        each = [
            optimize.brentq(lambda x, p=p: self.share_below(x) - p, *self.ends, rtol=1e-9)
            for p in wanted.ravel()
        ]
        return np.reshape(each, wanted.shape)


def claims_page(claims: pd.DataFrame, by_scheme: pd.DataFrame) -> str:
    """Page (HTML, self-contained) with all claims and their verdicts."""
    from accelstudy.pages import render  # which shows numbers as here

    papers, own = _papers_and_own(claims)
    return render(
        "study/claims/page.html.j2",
        claims=papers,
        own=own,
        schemes=by_scheme.to_dict("records"),
        next_steps=[
            ("See what another study would run", f"accelstudy cells config/config.yaml {SWEEP}"),
            ("Run it", f"snakemake --cores 2 --configfile {SWEEP}"),
        ],
    )


def claims_markdown(claims: pd.DataFrame) -> str:
    """The claims as tables in Markdown, one row each: those of the paper, then of this project."""
    papers, own = _papers_and_own(claims)
    lines = [
        "| section | claim | paper | ours (95 % interval) | verdict | |",
        "|---|---|---|---|---|---|",
    ]
    for row in papers:
        paper = "–" if math.isnan(row["paper"]) else f"{number(row['paper'])}{_unit(row)}"
        lines.append(f"| {row['section']} | {row['statement']} | {paper} | {_judged(row)}")
    if own:
        lines += ["", "| claim of this project | found (95 % interval) | verdict | |"]
        lines += ["|---|---|---|---|"]
        lines += [f"| {row['statement']} | {_judged(row)}" for row in own]
    return "\n".join(lines) + "\n"


def _papers_and_own(claims: pd.DataFrame) -> tuple[list[dict[Any, Any]], list[dict[Any, Any]]]:
    """Claims of the paper, and those of this project, which are of no section."""
    of_paper = claims["section"] != ""
    return claims[of_paper].to_dict("records"), claims[~of_paper].to_dict("records")


def _judged(row: Mapping[Any, Any]) -> str:
    """Number, verdict and sentence, as the last cells of a row in Markdown."""
    spread = interval(row["ci95_low"], row["ci95_high"])
    ours = f"{number(row['ours'])}{_unit(row)}" + (f" ({spread})" if spread else "")
    return f"{ours} | **{row['verdict']}** | {row['sentence']} |"


def _unit(row: Mapping[Any, Any]) -> str:
    return "" if row["unit"] in ("1", "ratio") else f" {row['unit']}"
