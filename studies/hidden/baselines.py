"""Simpler methods on the same campaigns, with the same signatures of the effects.

They work on the residuals z of unit weight after the parameters of the model (r dimensions), in
which a shape of an effect lies in the space of an orthonormal basis Q (d columns).
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from accelstudy.adjustment.quality import solve
from accelstudy.basics.errors import InputError
from accelstudy.campaign.calibration.fit import fit_campaign, usual_approach
from accelstudy.campaign.session import Campaign
from accelstudy.diagnosis.space.examined import examine
from accelstudy.diagnosis.space.hypotheses import OUTLIER, Hypothesis
from accelstudy.effects import effects_without
from accelstudy.files.tables import write_table
from accelstudy.sensors.models import get_model
from accelstudy.sensors.sensor import SensorModel
from studies.hidden.campaigns import SCHEMA, Made, Row, made_of, rows_table, simulated, tried
from studies.hidden.cells import Cell
from studies.hidden.config import HiddenConfig

Array = NDArray[np.float64]

LEVEL = 0.05
"""Level of all tests together, with Bonferroni's correction for the number of shapes."""
MOST = 2
"""Effects that a forward selection adds, as many as a diagnosis names."""
FOLDS = 5

Answer = tuple[bool, list[str]]
"""Whether something is missing, and the names that are given, strongest first."""


def run_baselines(
    config: HiddenConfig,
    campaigns: Iterable[tuple[Cell, int]],
    output: str | Path,
    provenance: Mapping[str, Any],
) -> None:
    """Let the simpler methods judge some of the campaigns.

    Parameters are those of `studies.hidden.diagnosing.run_chunk`. Where the
    model cannot be fitted, no method can work: each finds nothing, and the row has the error.
    """
    model, rows = get_model(config.model), []

    def answer(made: Made) -> list[Row]:
        return [
            {"method": method, "detected": detected, "found": json.dumps(names), "error": ""}
            for method, (detected, names) in answers(made.campaign, model)
        ]

    for cell, k in campaigns:
        if cell.one_in(config.baselines_every, k):
            made, truth = made_of(cell, k, simulated(config.seed))
            with effects_without(cell.removed):
                answered, error = tried(answer, made, f"{cell.name} {k}")
            nothing = {"detected": False, "found": "[]", "error": error or truth["failed"]}
            answered = answered or [{"method": method, **nothing} for method in METHODS]
            rows += [{"cell": cell.name, "campaign": k, **row} for row in answered]
    write_table(output, rows_table(rows, SCHEMA["baselines"]), provenance)


@dataclass(frozen=True)
class Problem:
    """Residuals and the shapes of all effects of the catalogue.

    Attributes
    ----------
    z : (m,) array; redundancy : int
    shapes : list of Hypothesis
    sigma_known : bool
    """

    z: Array
    redundancy: int
    shapes: list[Hypothesis]
    sigma_known: bool

    @classmethod
    def of(cls, campaign: Campaign, model: SensorModel) -> Problem:
        """Problem of a campaign; an unknown sigma is that of the residuals."""
        approach = usual_approach(campaign)
        sigma_known = campaign.sigma_force is not None
        fit = fit_campaign(campaign, model, approach)
        for _ in range(0 if sigma_known else 2):
            fit = fit_campaign(replace(campaign, sigma_force=fit.sigma_position_posteriori),
                               model, approach)  # fmt: skip
        examined = examine(solve(fit.model, fit.approach, fit.observed, fit.adjustment))
        shapes = [
            h
            for name, hypotheses in examined.candidates.items()
            if name != OUTLIER
            for h in hypotheses
        ]
        residuals = examined.frame.residuals
        return cls(residuals.z, residuals.redundancy, shapes, sigma_known)

    def left(self, chosen: list[Hypothesis]) -> Array:
        """Residuals that effects leave."""
        if not chosen:
            return self.z
        basis = np.linalg.qr(np.concatenate([h.basis for h in chosen], axis=1))[0]
        return np.asarray(self.z - basis @ (basis.T @ self.z))


def omnibus(problem: Problem) -> Answer | None:
    """Test the sum of squares against the given sigma: this detects and names nothing."""
    if not problem.sigma_known:
        return None
    p = stats.chi2.sf(problem.z @ problem.z, problem.redundancy)
    return bool(p < LEVEL), []


def known_sigma(problem: Problem) -> Answer | None:
    """Test each shape against the given sigma, and name the one with the smallest p-value."""
    if not problem.sigma_known:
        return None
    parts = _parts(problem)
    p = stats.chi2.logsf(parts, [h.dim for h in problem.shapes])
    return _smallest(problem, p)


def f_test(problem: Problem) -> Answer:
    """Test each shape against what it leaves; of those found, name the one with the best BIC."""
    dims, total = np.array([h.dim for h in problem.shapes]), float(problem.z @ problem.z)
    parts, rest = _parts(problem), problem.redundancy - dims
    p = stats.f.logsf(parts / dims / ((total - parts) / rest), dims, rest)
    detected, _ = _smallest(problem, p)
    return detected, [_by_bic(problem, [])[1].name] if detected else []


def forward_bic(problem: Problem) -> Answer:
    """Add shapes one by one, as long as the BIC becomes smaller."""
    chosen: list[Hypothesis] = []
    value = _bic(problem, [])
    while len(chosen) < MOST:
        best, shape = _by_bic(problem, chosen)
        if best >= value:
            break
        value, chosen = best, [*chosen, shape]
    return bool(chosen), [h.name for h in chosen]


def lasso(problem: Problem) -> Answer:
    """LassoCV on the signatures of all effects, each in the shape that fits best."""
    try:
        from sklearn.exceptions import ConvergenceWarning
        from sklearn.linear_model import LassoCV
    except ImportError:
        raise InputError(
            "the baseline lasso needs scikit-learn; it is in the group `baselines` of "
            "pyproject.toml, which `make env` installs"
        ) from None
    parts = _parts(problem)
    best: dict[str, int] = {}
    for i, shape in enumerate(problem.shapes):
        if shape.name not in best or parts[i] > parts[best[shape.name]]:
            best[shape.name] = i
    shapes = [problem.shapes[i] for i in best.values()]
    columns = np.concatenate([h.basis for h in shapes], axis=1)
    scale = np.sqrt(len(problem.z))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        fit = LassoCV(fit_intercept=False, cv=FOLDS, alphas=50).fit(columns * scale, problem.z)
    ends = np.cumsum([h.dim for h in shapes])[:-1]
    sizes = [float(np.linalg.norm(part)) for part in np.split(fit.coef_, ends)]
    ranked = sorted(zip(sizes, shapes, strict=True), key=lambda pair: -pair[0])
    names = [shape.name for size, shape in ranked if size > 0]
    return bool(names), names


METHODS: Mapping[str, Callable[[Problem], Answer | None]] = {
    "chi2 omnibus": omnibus,
    "known sigma": known_sigma,
    "F test": f_test,
    "BIC forward": forward_bic,
    "lasso": lasso,
}
"""Each method by its name; None where it does not apply."""


def answers(campaign: Campaign, model: SensorModel) -> Iterator[tuple[str, Answer]]:
    """Answers of all methods that apply to a campaign."""
    problem = Problem.of(campaign, model)
    for name, method in METHODS.items():
        answer = method(problem)
        if answer is not None:
            yield name, answer


def _parts(problem: Problem) -> Array:
    """Squares of what the residuals have in each shape, (s,)."""
    return np.array([float(np.sum((problem.z @ h.basis) ** 2)) for h in problem.shapes])


def _smallest(problem: Problem, logs: Array) -> Answer:
    """Judge the smallest of the logarithms of p-values (s,)."""
    first = int(np.argmin(logs))
    detected = bool(logs[first] + np.log(len(logs)) < np.log(LEVEL))
    return detected, [problem.shapes[first].name] if detected else []


def _bic(problem: Problem, chosen: list[Hypothesis]) -> float:
    """BIC of the residuals, with the sigma that is given or an unknown one."""
    left, r = problem.left(chosen), problem.redundancy
    omega, k = float(left @ left), sum(h.dim for h in chosen)
    return (omega if problem.sigma_known else r * np.log(omega)) + k * np.log(r)


def _by_bic(problem: Problem, chosen: list[Hypothesis]) -> tuple[float, Hypothesis]:
    """Return the shape whose BIC beside those chosen is the smallest, and that BIC."""
    taken = {h.name for h in chosen}
    used = sum(h.dim for h in chosen)
    values = [
        (_bic(problem, [*chosen, h]), i)
        for i, h in enumerate(problem.shapes)
        if h.name not in taken and used + h.dim < problem.redundancy
    ]
    if not values:
        return np.inf, problem.shapes[0]
    value, i = min(values)
    return value, problem.shapes[i]
