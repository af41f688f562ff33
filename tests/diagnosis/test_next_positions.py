"""Where to measure next: beside all candidates, each fitted by brute force."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_helpers import shuffled
from norm_model import SHOWN, nine
from usual import GRAVITY, NINE, ROBOT, G

import accelstudy as acs
from accelstudy.adjustment.quality import solve
from accelstudy.basics.units import GON
from accelstudy.campaign.calibration.fit import fit_campaign
from accelstudy.diagnosis.next_positions import CANDIDATE_SCHEME, candidate_rows, next_positions
from accelstudy.diagnosis.space.frame import SessionFit
from accelstudy.leveling.angles import specific_force
from accelstudy.schemes import get_scheme
from accelstudy.sensors.models import compose
from accelstudy.simulation.sessions import Noise, session

QUADRATIC = np.array([4e-4, -3e-4, 2e-4])
SIGMA = 0.002


@pytest.fixture(scope="module")
def rivals():
    """Readings of a sensor with a quadratic scale, for which two effects may stand.

    The noise makes that either predicts other things of what the other one says.
    """
    model = compose("quadratic", (*(e.spec for e in NINE.effects), "quadratic_scale"))
    directions = shuffled("fibonacci-16")
    ideal = session(model, np.append(np.zeros(9), QUADRATIC), directions, G)
    observed = ideal.draw(Noise(sigma_force=SIGMA), 1, np.random.default_rng(2))
    frame = SessionFit.of(solve(NINE, GRAVITY, replace(observed, angles=None)))
    shapes = [frame.candidates[name][0] for name in ("quadratic_scale", "cubic_scale")]
    seen = (np.linalg.norm(observed.forces[0], axis=1) - G) / SIGMA
    return frame, shapes, -directions, seen


def rows(u, name):
    """Rows of the adjustment with an effect, of unit weight, for forces along u (n, 3)."""
    return np.column_stack([nine(u), SHOWN[name](u, G)]) / SIGMA


def fitted(design, seen):
    """Parameters and the sum of squares of what a fit leaves."""
    values = np.linalg.lstsq(design, seen, rcond=None)[0]
    return values, np.sum((seen - design @ values) ** 2)


def separations(u, old, taken, candidates):
    """What each candidate adds to what one explanation leaves of what the other one predicts."""
    names = ("quadratic_scale", "cubic_scale")
    total = np.zeros(len(candidates))
    for right, wrong in (names, names[::-1]):
        told = fitted(rows(u, right), old)[0]
        before = np.concatenate([u, taken])
        seen = rows(before, right) @ told
        least = fitted(rows(before, wrong), seen)[1]
        for i, one in enumerate(candidates):
            more = np.append(seen, rows(one[None], right) @ told)
            total[i] += fitted(rows(np.vstack([before, one]), wrong), more)[1] - least
    return total / 2


def test_each_position_adds_most_of_all_candidates(rivals):
    """One after the other, each in an attitude of its own, beside those that were taken before."""
    frame, (quadratic, cubic), u, old = rivals
    found = next_positions(frame, (quadratic,), (cubic,))
    assert len(found) == 3
    candidates = -get_scheme(CANDIDATE_SCHEME).directions
    alone = separations(u, old, np.empty((0, 3)), candidates)
    taken = np.empty((0, 3))
    for position in found:
        force = np.array(specific_force(position.roll_gon * GON, position.pitch_gon * GON, 1.0))
        far = np.linalg.norm(candidates[:, None] - taken, axis=2)
        free = np.all(far > 0.5, axis=1)
        gains = separations(u, old, taken, candidates)
        here = int(np.argmin(np.linalg.norm(candidates - force, axis=1)))
        assert candidates[here] == pytest.approx(force, abs=1e-3)
        assert free[here]
        assert gains[here] == pytest.approx(gains[free].max(), rel=0.02)
        taken = np.vstack([taken, force])
    # Some attitudes would tell much less, so that the choice matters.
    assert np.median(alone) < 0.5 * alone.max()
    assert found[0].temperature_degC is found[0].later_s is None
    assert found[0].separates == ["quadratic_scale", "cubic_scale"]


def test_an_effect_more_is_tested_as_well(rivals):
    """The larger explanation has all that the smaller one predicts."""
    frame, (quadratic, cubic), *_ = rivals
    for both in (((quadratic, cubic), (cubic,)), ((cubic,), (quadratic, cubic))):
        assert [one.separates for one in next_positions(frame, *both)] == [["quadratic_scale"]] * 3


@pytest.mark.parametrize("name", ["quadratic_scale", "encoder_eccentricity"])
def test_candidates_show_an_effect_as_an_adjustment_with_it_does(name):
    """In the positions of a session, beside its parameters; a reading has a sign, too."""
    observed = session(NINE, np.zeros(9), shuffled("fibonacci-24"), G).observations(Noise())
    extended = solve(compose("with it", (*(e.spec for e in NINE.effects), name)), ROBOT, observed)
    frame = SessionFit.of(solve(NINE, ROBOT, observed))
    effect = frame.candidates[name][0]
    found = candidate_rows(frame, frame.forces, frame.hold, [effect]).reshape(72, -1)
    expected = np.hstack([extended.design[:, :9], extended.design[:, 9:] @ effect.directions])
    np.testing.assert_allclose(found.T @ found, expected.T @ expected, rtol=1e-6, atol=1e-3)


def test_effects_of_time_are_told_apart_later():
    campaign = acs.simulate_campaign(
        scheme="fibonacci-30", interval=60.0, effects=("bias_drift: 1e-5, 1e-5, 1e-5",)
    )
    fit = fit_campaign(campaign, NINE, ROBOT)
    frame = SessionFit.of(fit.solution)
    drift, warm = (frame.candidates[name][0] for name in ("bias_drift", "warm_up"))
    found = next_positions(frame, (drift,), (warm,))
    assert all(position.temperature_degC is None for position in found)
    assert [position.later_s for position in found] == pytest.approx([30 * 60.0] * 3)
    assert found[0].separates == ["bias_drift", "warm_up"]
    # What both explanations have in common separates nothing.
    quadratic = frame.candidates["quadratic_scale"][0]
    both = next_positions(frame, (drift, quadratic), (warm, quadratic))
    assert both[0].separates == ["bias_drift", "warm_up"]
