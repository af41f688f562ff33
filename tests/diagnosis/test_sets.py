"""The evidence for two and three candidates together, beside a basis of all their shapes."""

from itertools import combinations, permutations, product

import numpy as np
import pytest
from diagnosis_helpers import design, shuffled, some_holds
from usual import GRAVITY, ROBOT

from accelstudy.diagnosis.evidence.sets import set_prior, weigh_sets
from accelstudy.diagnosis.evidence.size import Evidence, Level
from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.space.hypotheses import OUTLIER, Hypotheses

APART = 0.05
"""Share of one space that has to be left beside the other, in squares."""
CHOSEN = {
    "robot": ("warm_up", "thermal_bias", "scale_asymmetry", "base_tilt", OUTLIER),
    "gravity": ("warm_up", "quadratic_scale", "scale_asymmetry", OUTLIER),
}
"""Smooth shapes, shapes that are even, single ones, near rivals, and outlying positions."""


@pytest.fixture(scope="module", params=[ROBOT, GRAVITY], ids=lambda approach: approach.name)
def problem(request):
    directions = shuffled("fibonacci-9" if request.param is ROBOT else "icosahedron-12")
    directions = np.concatenate([directions, directions[:6]])
    frame = design(directions, request.param, some_holds(len(directions)), seed=3)
    chosen = CHOSEN[request.param.name]
    shapes = {name: frame.candidates[name] for name in chosen if name in frame.candidates}
    residuals = frame.residuals
    return shapes, residuals, Evidence(Level.of_stated_sigma(), residuals.redundancy)


def log_density(hypotheses, residuals, evidence):
    """Log density of the residuals by an orthonormal basis of all shapes; None if one is lost."""
    basis = hypotheses[0].basis
    for one in hypotheses[1:]:
        left = one.basis - basis @ (basis.T @ one.basis)
        if np.linalg.svd(left, compute_uv=False)[-1] ** 2 <= APART:
            return None
        basis = np.linalg.qr(np.concatenate([basis, left], axis=1))[0]
    if basis.shape[1] >= residuals.redundancy:
        return None
    part = np.array([np.sum((basis.T @ residuals.z) ** 2)])
    return float(evidence.spaces_density(part, [basis.shape[1]], residuals.z @ residuals.z)[0])


def pairs_of(shapes, residuals, evidence):
    """Log density of every two names over all shapes of both, with their prior probabilities."""
    found = {}
    for one, other in [*combinations(shapes, 2), (OUTLIER, OUTLIER)]:
        tried = [list(enumerate(shapes[name])) for name in (one, other)]
        both = combinations(tried[0], 2) if one == other else product(*tried)
        logs = [
            log + np.log(shapes[one].prior[i] * shapes[other].prior[j] * (1 + (one == other)))
            for (i, a), (j, b) in both
            if (log := log_density((a, b), residuals, evidence)) is not None
        ]
        if logs:
            found[tuple(sorted((one, other)))] = np.logaddexp.reduce(logs)
    return found


def by_names(found):
    return {tuple(sorted(h.name for h in shapes)): log for shapes, log in found}


def test_sets_of_shapes_have_the_density_of_their_joint_space(problem):
    """One shape of each candidate: exact for every pair, and for every set of three."""
    shapes, residuals, evidence = problem
    single = {name: Hypotheses.of([own[0]]) for name, own in shapes.items() if name != OUTLIER}
    found, expected = by_names(weigh_sets(single, residuals, evidence)), {}
    for size in (2, 3):
        for names in combinations(single, size):
            # Whether enough is left may depend on the order in which they are taken.
            orders = [[single[name][0] for name in order] for order in permutations(names)]
            logs = [log_density(one, residuals, evidence) for one in orders]
            if any(log is not None for log in logs):
                expected[tuple(sorted(names))] = next(log for log in logs if log is not None)
    assert set(found) <= set(expected)
    assert len(found) > len(expected) / 2
    assert any(len(names) == 3 for names in found) == (residuals.redundancy > 9)
    for names, one in found.items():
        assert one == pytest.approx(expected[names], abs=1e-6)


def test_pairs_are_close_to_those_over_all_shapes(problem):
    """A member that is held at its best shape costs little."""
    found, expected = by_names(weigh_sets(*problem)), pairs_of(*problem)
    pairs = {names: log for names, log in found.items() if len(names) == 2}
    assert len(expected) / 2 < len(pairs) <= len(expected)
    for names, log in pairs.items():
        assert log == pytest.approx(expected[names], abs=0.8)


def test_one_candidate_makes_no_set(problem):
    shapes, residuals, evidence = problem
    assert weigh_sets({"warm_up": shapes["warm_up"]}, residuals, evidence) == []
    assert weigh_sets({}, residuals, evidence) == []


def test_shapes_of_a_smooth_setting_weigh_by_its_logarithm(problem):
    warm_up = problem[0]["warm_up"]
    weights = np.gradient(np.log([one.value for one in warm_up]))
    assert warm_up.prior == pytest.approx(weights / weights.sum())


def test_priors_of_all_sets_of_a_size_have_a_fixed_sum():
    """C(k + j − 1, j) sets of j of k classes; each further member costs as much."""
    for k in (2, 7, 30):
        for size, count in ((1, k), (2, k * (k + 1) / 2), (3, k * (k + 1) * (k + 2) / 6)):
            total = count * np.exp(set_prior(size, k))
            assert total == pytest.approx(RULES.prior_two ** (size - 1))
