"""The evidence for all pairs, beside every two shapes taken together one by one."""

from itertools import combinations, product

import numpy as np
import pytest
from diagnosis_helpers import GRAVITY, ROBOT, design, shuffled, some_holds

from accelstudy.diagnosis.evidence import hypotheses
from accelstudy.diagnosis.evidence.hypotheses import all_pairs
from accelstudy.diagnosis.evidence.size import Evidence, Level
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
    monkeypatch.setattr(hypotheses, "POSITIONS", 4)
    alone = [np.sum((h.basis.T @ residuals.z) ** 2) for h in shapes[OUTLIER]]
    places = sorted(np.argsort(alone)[-4:].tolist())
    assert_same(all_pairs(*problem), one_by_one(shapes, residuals, evidence, places))


def density_of_three(three, residuals, evidence):
    """Log density with three shapes; None where no position is seen beside the two others."""
    z, bases = residuals.z, [h.basis for h in three]
    dims = sum(h.dim for h in three)

    def seen(one, other):
        return 1 - np.linalg.svd(one.T @ other, compute_uv=False)[0] ** 2 > APART

    orders = [((0, 1), 2), ((0, 2), 1), ((1, 2), 0)][: 2 if three[0].effect else 3]
    together = [
        np.linalg.qr(np.concatenate([bases[i] for i in two], axis=1))[0] for two, _ in orders
    ]
    if dims >= residuals.redundancy or not any(
        seen(bases[i], bases[j]) and seen(bases[k], both)
        for ((i, j), k), both in zip(orders, together, strict=True)
    ):
        return None
    basis = np.linalg.qr(np.concatenate(bases, axis=1))[0]
    return evidence.of_spaces(np.array([np.sum((basis.T @ z) ** 2)]), [dims], z @ z)[0]


def test_two_and_three_bumps_beside_what_is_paired(problem, monkeypatch):
    """If all pairs are gone on from, it is the mean over all sets of positions."""
    shapes, residuals, evidence = problem
    for name in ("FIRST", "STRONGEST"):
        monkeypatch.setattr(hypotheses, name, 10**6)
    three = [together for together in all_pairs(*problem) if len(together.best) == 3]
    made = {together.best[0].name: together for together in three}
    bumps = shapes[OUTLIER]
    ((effect,), n) = shapes["scale_asymmetry"], len(bumps)
    for name, sets, order in (
        ("scale_asymmetry", [(effect, *two) for two in combinations(bumps, 2)], 2 / n**2),
        (OUTLIER, [*combinations(bumps, 3)], 6 / n**3),
    ):
        logs = [density_of_three(three, residuals, evidence) for three in sets]
        total = np.logaddexp.reduce([log for log in logs if log is not None]) + np.log(order)
        assert made[name].log_density == pytest.approx(total, abs=1e-6)
        best = sets[max(range(len(sets)), key=lambda i: -np.inf if logs[i] is None else logs[i])]
        assert {h.place for h in made[name].best} == {h.place for h in best}


def test_one_candidate_makes_no_pair(problem):
    shapes, residuals, evidence = problem
    assert all_pairs({"warm_up": shapes["warm_up"]}, residuals, evidence) == []
