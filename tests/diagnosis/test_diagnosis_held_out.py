"""Held-out positions: what they need to confirm a name, given that a name was given."""

from types import SimpleNamespace

import numpy as np
import pytest
from diagnosis_helpers import NINE, ROBOT, G, shuffled

from accelstudy.adjustment.quality import solve
from accelstudy.diagnosis.decision.search import Search
from accelstudy.diagnosis.evidence.size import Level
from accelstudy.diagnosis.held_out import confirmation as held_out
from accelstudy.diagnosis.held_out import given_a_name
from accelstudy.diagnosis.held_out.gap import SIGNIFICANT, held_out_gap, split_positions
from accelstudy.diagnosis.held_out.linear import LinearSplit
from accelstudy.diagnosis.result import LEVEL_EFFECTS
from accelstudy.simulation.sessions import Noise, session

SETS = 25_000


@pytest.fixture(scope="module", params=[Level.given(), Level.unknown()], ids=["given", "not given"])
def parts(request):
    """Searches of all positions and of two thirds, and the split, with nothing missing."""
    ideal = session(NINE, np.zeros(NINE.n_parameters), shuffled("fibonacci-30"), G)
    observed = ideal.draw(Noise(), 1, np.random.default_rng(5))
    seed = np.random.SeedSequence(1)
    search = Search(solve(NINE, ROBOT, observed), seed, request.param)
    frame = search.examined.frame
    fitted, held = split_positions(frame.forces, frame.hold, 10, np.random.default_rng(2))
    part = Search(solve(NINE, ROBOT, observed.take(fitted)), seed, request.param)
    return search, part, LinearSplit(frame, fitted, held)


def test_a_name_that_noise_made_is_confirmed_in_5_percent(parts):
    """In plain noise, of which few sets are given a name, instead of by importance sampling."""
    search, part, split = parts
    needed = given_a_name.needed_z(search, part, split, LEVEL_EFFECTS, np.random.default_rng(3))
    assert needed > SIGNIFICANT + 0.3
    residuals, field, rng = search.residuals, search.field, np.random.default_rng(4)
    noise = rng.standard_normal((SETS, len(residuals.design)))
    z = residuals.project(noise.T).T
    logs = field.densities(search.evidence, z)
    nothing = np.logaddexp.reduce(search.evidence.of_noise(np.sum(z**2, axis=1)), axis=-1)
    odds = np.logaddexp.reduce(logs, axis=1) - np.log(len(field.names)) - nothing
    label = given_a_name._labels(search)
    named, top = given_a_name._named(logs, [label[name] for name in field.names])
    found = np.flatnonzero(named & (odds > search.detection.by_chance.beyond(LEVEL_EFFECTS)))
    chosen, values = given_a_name._on_the_part(part, split, noise[found], rng)
    same = np.array([label.get(name, -2) for name in chosen]) == top[found]
    n = len(found)
    assert n > 150
    rate = np.mean(same & (values > needed))
    # Both the simulation of the bound and that of the rate err.
    assert rate == pytest.approx(0.05, abs=4 * np.sqrt(0.05 * 0.95 * (1 / n + 1 / 300)))
    # Without regard to the name, as if it were independent, far more would be confirmed.
    assert np.mean(same & (values > SIGNIFICANT)) > 0.12


def test_prediction_to_first_order_is_that_of_refits(parts):
    """Of an effect that the fitted positions show; what either leaves of the held-out ones."""
    search, part, split = parts
    best = part.best_shape("quadratic_scale")
    fit = part.refits.refit([best])
    rest = search.first.observed.take(split.held)
    gap = held_out_gap(part.first, fit, rest, split.held, 1.0, np.random.default_rng(1))
    left, missed = split.beside(search.residuals.positions.errors[None])
    change = split.corrections(search.best_shape("quadratic_scale"), left)
    assert np.mean(missed**2) == pytest.approx(gap.before, rel=0.02)
    assert np.mean((missed - change) ** 2) == pytest.approx(gap.after, rel=0.02)


def test_a_part_that_can_show_no_pair_chooses_none():
    """Positions that are too few for two effects at once would not have chosen these two."""
    part = SimpleNamespace(pairs=[])
    finding = SimpleNamespace(chosen=("one", "other"), credible_set=())
    assert held_out._chosen_alike(part, finding) == (("one", "other"), True)
