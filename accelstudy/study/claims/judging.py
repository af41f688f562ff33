"""The claims judged by the files of a study: verdicts as tables, as a page and as Markdown."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd

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
    EDGES,
    PROBABILITIES,
    Controlled,
    Sample,
    apart_by_quantile,
)
from accelstudy.study.monte_carlo.followed import EFFECT, cell_tilt_error
from accelstudy.study.monte_carlo.replicates import Replicates, read_replicates
from accelstudy.study.monte_carlo.statistics import Statistics

TABLES = ("cells", "summary", "correlations", "sensitivity", "shapley")
"""What the claims are judged by, beside estimates."""
SWEEP = "config/sweeps/positions.yaml"
"""A study for readers of the claims who want one of their own."""


def judge_claims(
    study: StudyConfig,
    estimates: Sequence[str | Path],
    tables: Mapping[str, str | Path],
    outputs: Mapping[str, str],
    provenance: Mapping[str, Any],
) -> None:
    """Judge the paper's claims, and those of this project.

    Parameters
    ----------
    study : StudyConfig, with `sensitivity`
    estimates : files with the estimates of the cells that the claims use
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
        estimates,
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
    estimates: Sequence[str | Path],
    leveling: Mapping[str, Any],
    **rest: Any,
) -> Evidence:
    """Collect the evidence.

    Parameters
    ----------
    cells : cells with the model of the claims
    estimates : files with the estimates of these cells
    leveling : mapping with max_tilt_gon and attitudes
    **rest : as in `Evidence`
    """
    found = {}
    for cell in cells:
        if not cell.estimability.estimable:
            continue
        tilt = cell_tilt_error(cell, leveling)
        control = Control.of(cell, tilt)
        replicates = read_replicates(estimates, cell, control)
        if replicates is not None:
            statistics = Statistics.of(cell, replicates, control, tilt)
            found[cell.scheme, cell.approach] = _Calibrations(cell, statistics, control, replicates)
    ratios: dict[tuple[str, str], Controlled] = {}
    for scheme in schemes_with_both(found):
        pair = found[scheme, "gravity"], found[scheme, "robot"]
        if all(each.statistics.redundancy > 0 and each.statistics.converged for each in pair):
            for effect in pair[0].statistics.followed.effects:
                ratios[scheme, effect] = _ratio(*pair, effect)
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
    replicates: Replicates


def _ratio(gravity: _Calibrations, robot: _Calibrations, effect: str) -> Controlled:
    """Ratio of the sigma of an effect, robot-aided over gravity-based, of independent sessions.

    Calibrations are paired by their number.
    """
    n = min(gravity.statistics.converged, robot.statistics.converged)
    above, linear_above = _sigmas(robot, effect)
    below, linear_below = _sigmas(gravity, effect)
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


def _sigmas(of: _Calibrations, effect: str) -> tuple[Array, Array]:
    """Sigma of an effect in the calibrations that converged, and by linear theory."""
    followed, (simulated, linear) = of.statistics.followed, of.replicates
    column = followed.keys.index((EFFECT, effect))
    own = followed.values(simulated)[:, column]
    if linear is None:
        return own, own
    return own, followed.values(linear)[simulated.converged, column]


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
