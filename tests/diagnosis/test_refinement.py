"""Shapes between those that are tried at first: the best of all, beside a search through them."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_helpers import design, shuffled, some_holds
from usual import GRAVITY, ROBOT

from accelstudy.diagnosis.evidence.candidates import refine, reshape
from accelstudy.diagnosis.space.hypotheses import OUTLIER

SIZE = 8.0
"""Of what is hidden, in standard deviations of a position."""


def hidden(course, n=40, seed=1):
    """A session of n holds with a course of time (n,) on all axes and noise, and how much of the
    residuals courses (n, k) would explain."""
    frame = design(shuffled(f"fibonacci-{n}"), ROBOT, some_holds(n))
    residuals = frame.residuals

    def rows(values):
        """Three columns of unit weight for each of so many courses, (k, m, 3)."""
        change = residuals.by_observations[..., :3]
        each = [residuals.stack(change * one[:, None, None]) for one in values.T]
        return np.array([residuals.project(one) for one in each])

    shown = rows(course[:, None])[0]
    rng = np.random.default_rng(seed)
    errors = residuals.project(rng.standard_normal(len(residuals.design)))
    errors += shown @ (SIZE * rng.standard_normal(3)) / np.linalg.norm(shown, 2) * np.sqrt(3)
    changed = replace(residuals, errors=errors)
    frame = replace(frame, residuals=changed)

    def explained(courses):
        bases = np.linalg.qr(rows(courses))[0]
        return np.sum(np.einsum("kml,m->kl", bases, changed.z) ** 2, axis=1)

    return frame, explained


@pytest.mark.parametrize("tau", [170.0, 430.0, 1150.0])
def test_a_time_constant_is_the_best_of_a_fine_search(tau):
    time = 60.0 * np.arange(40)
    frame, explained = hidden(np.exp(-time / tau))
    taus = np.geomspace(120, 2340, 1500)
    parts = explained(np.exp(-time[:, None] / taus))
    before = frame.candidates["warm_up"]
    after = refine(frame, before)
    z = frame.residuals.z
    best = after.strongest(z)
    assert np.sum((z @ best.basis) ** 2) == pytest.approx(parts.max(), abs=0.1)
    assert best.value == pytest.approx(taus[np.argmax(parts)], rel=0.012)
    assert before.parts(z).max() < parts.max() - 1
    values = [h.value for h in after]
    assert values == sorted(values)
    assert {h.value for h in before} <= set(values)


def test_of_very_many_times_of_a_jump_the_best_is_found():
    """Not every time is tried at first; those that were passed over come in where it matters."""
    n = 130
    time = 60.0 * np.arange(n)
    frame, explained = hidden((time > 60 * 87.5).astype(float), n)
    middles = time[1:-2] + 30
    parts = explained((time[:, None] > middles).astype(float))
    before = frame.candidates["bias_jump"]
    assert len(before) < len(middles)
    best = refine(frame, before).strongest(frame.residuals.z)
    assert best.effect.settings["t"] == middles[np.argmax(parts)]
    tried = {h.effect.settings["t"] for h in before}
    assert best.effect.settings["t"] not in tried


def test_a_shape_that_shows_less_is_none():
    """What is over after the first hold is one number for a norm, not one for each axis."""
    frame = design(shuffled("fibonacci-30"), GRAVITY, some_holds(30))
    warm_up = frame.candidates["warm_up"][3]
    assert warm_up.dim == 3
    assert reshape(frame, warm_up, 300.0).dim == 3
    assert reshape(frame, warm_up, 1.0) is None


@pytest.mark.parametrize("name", ["scale_asymmetry", OUTLIER])
def test_what_has_no_shapes_between_stays_as_it_is(name):
    frame, _ = hidden(np.ones(12) * np.arange(12), 12)
    shapes = frame.candidates[name]
    assert refine(frame, shapes) is shapes
