"""Simpler methods on the same campaigns, with the same signatures of the effects.

They work on the residuals z of unit weight after the parameters of the model (r dimensions), in
which a shape of an effect lies in the space of an orthonormal basis Q (d columns).
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np
from scipy import stats

from accelstudy.basics.arrays import Array
from accelstudy.campaign.calibration.fit import fit_campaign, usual_approach
from accelstudy.campaign.session import Campaign
from accelstudy.diagnosis.space.frame import SessionFit
from accelstudy.diagnosis.space.hypotheses import OUTLIER, Hypothesis
from accelstudy.sensors.sensor import SensorModel

LEVEL = 0.05  # level of all tests together, with Bonferroni's correction for the number of shapes
MOST = 2  # effects that a forward selection adds, as many as a diagnosis names
FOLDS = 5

Answer = tuple[bool, list[str]]
"""Whether something is missing, and the names that are given, strongest first."""


class Problem:
    """Residuals of a campaign and the shapes of all effects of the catalogue.

    Attributes
    ----------
    z : (m,) array; redundancy : int
    shapes : list of Hypothesis
    dims, parts : (s,) arrays, their dimensions, and the squares of what the residuals have in each
    sigma_known : bool; an unknown sigma is that of the residuals
    """

    def __init__(self, campaign: Campaign, model: SensorModel) -> None:
        approach, self.sigma_known = usual_approach(campaign), campaign.sigma_force is not None
        fit = fit_campaign(campaign, model, approach)
        frame = SessionFit.of(fit.solution)
        self.z, self.redundancy = frame.residuals.z, frame.residuals.redundancy
        candidates = frame.candidates.items()
        self.shapes = [
            h for name, shapes in candidates if name != OUTLIER for h in shapes.hypotheses
        ]
        self.dims = np.array([h.dim for h in self.shapes])
        self.parts = np.array([np.sum((self.z @ h.basis) ** 2) for h in self.shapes])

    def bic(self, chosen: Sequence[Hypothesis]) -> float:
        """BIC of what shapes leave of the residuals, with a given sigma or an unknown one."""
        left, r, k = self.z, self.redundancy, sum(h.dim for h in chosen)
        if k >= r:
            return np.inf
        if chosen:
            basis = np.linalg.qr(np.concatenate([h.basis for h in chosen], axis=1))[0]
            left = left - basis @ (basis.T @ left)
        omega = float(left @ left)
        return (omega if self.sigma_known else r * np.log(omega)) + k * np.log(r)

    def more(self, chosen: Sequence[Hypothesis] = ()) -> list[Hypothesis]:
        """Shapes with the one more that has the smallest BIC beside them."""
        names = {h.name for h in chosen}
        return min(([*chosen, h] for h in self.shapes if h.name not in names), key=self.bic)

    def smallest(self, logs: Array) -> Answer:
        """Judge the smallest of the logarithms of p-values (s,)."""
        first = int(np.argmin(logs))
        detected = bool(logs[first] + np.log(len(logs)) < np.log(LEVEL))
        return detected, [self.shapes[first].name] if detected else []


def omnibus(problem: Problem) -> Answer | None:
    """Test the sum of squares against the given sigma: this detects and names nothing."""
    p = stats.chi2.sf(problem.z @ problem.z, problem.redundancy)
    return (bool(p < LEVEL), []) if problem.sigma_known else None


def known_sigma(problem: Problem) -> Answer | None:
    """Test each shape against the given sigma, and name the one with the smallest p-value."""
    logs = stats.chi2.logsf(problem.parts, problem.dims)
    return problem.smallest(logs) if problem.sigma_known else None


def f_test(problem: Problem) -> Answer:
    """Test each shape against what it leaves; of those found, name the one with the best BIC."""
    dims, parts, total = problem.dims, problem.parts, float(problem.z @ problem.z)
    rest = problem.redundancy - dims
    p = stats.f.logsf(parts / dims / ((total - parts) / rest), dims, rest)
    detected, _ = problem.smallest(p)
    return detected, [h.name for h in problem.more()] if detected else []


def forward_bic(problem: Problem) -> Answer:
    """Add shapes one by one, as long as the BIC becomes smaller."""
    chosen: list[Hypothesis] = []
    while len(chosen) < MOST and problem.bic(more := problem.more(chosen)) < problem.bic(chosen):
        chosen = more
    return bool(chosen), [h.name for h in chosen]


def lasso(problem: Problem) -> Answer:
    """LassoCV on the signatures of all effects, each in the shape that fits best."""
    from sklearn.linear_model import LassoCV

    best = {shape.name: shape for shape in problem.shapes}
    for i in np.argsort(-problem.parts, kind="stable")[::-1]:
        best[problem.shapes[i].name] = problem.shapes[i]
    columns = np.concatenate([h.basis for h in best.values()], axis=1)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of searches that have not converged
        fit = LassoCV(fit_intercept=False, cv=FOLDS, alphas=50)
        fit.fit(columns * np.sqrt(len(problem.z)), problem.z)
    ends = np.cumsum([h.dim for h in best.values()])[:-1]
    sizes = map(np.linalg.norm, np.split(fit.coef_, ends))
    ranked = sorted(zip(sizes, best, strict=True), key=lambda pair: -pair[0])
    names = [name for size, name in ranked if size > 0]
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
    problem = Problem(campaign, model)
    told = ((name, method(problem)) for name, method in METHODS.items())
    return ((name, answer) for name, answer in told if answer is not None)
