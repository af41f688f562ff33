"""The evidence for all pairs, beside every two shapes taken together one by one."""

from dataclasses import replace
from itertools import combinations, product

import numpy as np
import pytest
from diagnosis_helpers import GRAVITY, ROBOT, design, shuffled, some_holds

from accelstudy.diagnosis.evidence import hypotheses
from accelstudy.diagnosis.evidence.hypotheses import all_pairs
from accelstudy.diagnosis.evidence.size import Evidence, Level
from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.space.hypotheses import OUTLIER

APART = 0.05
"""Share of one space that has to be left beside the other, in squares."""
CHOSEN = {
    "robot": ("warm_up", "thermal_bias", "scale_asymmetry", "base_tilt", OUTLIER),
    "gravity": ("warm_up", "quadratic_scale", "scale_asymmetry", OUTLIER),
}
"""Smooth shapes, shapes that are even, single ones, near rivals, and bumped positions."""


@pytest.fixture(scope="module", params=[ROBOT, GRAVITY], ids=lambda approach: approach.name)
def problem(request):
    directions = shuffled("fibonacci-9" if request.param is ROBOT else "icosahedron-12")
    directions = np.concatenate([directions, directions[:6]])
    examined = design(directions, request.param, some_holds(len(directions)), seed=3)
    chosen = CHOSEN[request.param.name]
    shapes = {name: examined.candidates[name] for name in chosen if name in examined.candidates}
    residuals = examined.frame.residuals
    return shapes, residuals, Evidence(Level.given(), residuals.redundancy)


def prior(name, shapes):
    """Even over the logarithm of a time constant, else even."""
    if name != "warm_up":
        return np.full(len(shapes), 1 / len(shapes))
    weights = np.gradient(np.log([h.value for h in shapes]))
    return weights / weights.sum()


def one_by_one(shapes, residuals, evidence, places=None):
    """Log density of every two names, and their best shapes, by a basis of both together."""
    z, r = residuals.z, residuals.redundancy
    weights = {name: prior(name, own) for name, own in shapes.items()}
    found = {}
    names = [*combinations(shapes, 2), (OUTLIER, OUTLIER)]
    for one, other in names:
        tried = [range(len(shapes[name])) for name in (one, other)]
        if places is not None:
            tried = [
                places if n == OUTLIER else own for n, own in zip((one, other), tried, strict=True)
            ]
        both = combinations(tried[0], 2) if one == other else product(*tried)
        total, best, most = -np.inf, None, -np.inf
        for i, k in both:
            a, b = shapes[one][i], shapes[other][k]
            cosine = np.linalg.svd(a.basis.T @ b.basis, compute_uv=False)[0]
            if 1 - cosine**2 <= APART or a.dim + b.dim >= r:
                continue
            basis = np.linalg.qr(np.concatenate([a.basis, b.basis], axis=1))[0]
            part = np.array([np.sum((basis.T @ z) ** 2)])
            (log,) = evidence.of_spaces(part, [a.dim + b.dim], z @ z)
            # Two bumped positions have no order, so that each two stand for two.
            weight = weights[one][i] * weights[other][k] * (2 if one == other else 1)
            total = np.logaddexp(total, log + np.log(weight))
            if log > most:
                best, most = (a, b), log
        if best is not None:
            found[one, other] = total, best
    return found


def assert_same(made, expected):
    made = [together for together in made if len(together.best) == 2]
    assert {tuple(h.name for h in pair.best) for pair in made} == set(expected)
    for pair in made:
        total, best = expected[tuple(h.name for h in pair.best)]
        assert pair.log_density == pytest.approx(total, abs=1e-6)
        for found, wanted in zip(pair.best, best, strict=True):
            assert found.place == wanted.place
            assert found.effect is wanted.effect or found.effect.spec == wanted.effect.spec


def test_all_pairs_are_those_of_all_shapes_together(problem):
    expected = one_by_one(*problem)
    assert len(expected) >= 6
    assert_same(all_pairs(*problem), expected)


def test_of_many_positions_those_that_explain_most_are_paired(problem, monkeypatch):
    """The others keep their share of the prior, as if they explained nothing."""
    shapes, residuals, evidence = problem
    monkeypatch.setattr(hypotheses, "RULES", replace(RULES, paired_positions=4))
    alone = [np.sum((h.basis.T @ residuals.z) ** 2) for h in shapes[OUTLIER]]
    places = sorted(np.argsort(alone)[-4:].tolist())
    assert_same(all_pairs(*problem), one_by_one(shapes, residuals, evidence, places))


def test_one_candidate_makes_no_pair(problem):
    shapes, residuals, evidence = problem
    assert all_pairs({"warm_up": shapes["warm_up"]}, residuals, evidence) == []
