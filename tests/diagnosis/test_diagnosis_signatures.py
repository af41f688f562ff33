"""Signatures of effects: derivatives of the observations, and what a design shows of them."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_helpers import campaign, design, shuffled, some_holds
from usual import GRAVITY, NINE, G

from accelstudy.diagnosis.space.frame import Candidates, HoldColumns, signatures
from accelstudy.diagnosis.space.hypotheses import OUTLIER, Hypotheses
from accelstudy.diagnosis.visibility import examine_campaign, upper_limits, visibilities
from accelstudy.effects import effect_names, get_effect
from accelstudy.sensors.sensor import SensorModel
from accelstudy.simulation.sessions import session

EACH = pytest.mark.parametrize("name", effect_names())


FULL = session(NINE, np.zeros(9), shuffled("mclaren-24"), G, some_holds(24))


# --- derivatives ---------------------------------------------------------------------------------


@EACH
def test_a_signature_is_the_derivative_of_what_is_observed(name):
    """Finite differences of a sensor that has the model's effects and this one.

    The knee of the saturation and the signs of the forces stay on one side of a small step.
    """
    effect = get_effect(name)
    others = tuple(e for e in NINE.effects if e.name != name)
    model = SensorModel("both", (*others, effect))
    first = sum(len(e.parameters) for e in others)
    k = len(effect.parameters)
    # Effects act on the force along the sensitive axes, at an ideal sensor that of the body.
    shown = signatures((effect,), FULL.f_b, FULL.angles, G, HoldColumns(FULL.hold, 2))
    assert shown.force.shape == (len(FULL.f_b), 3, k)
    step = 1e-6 * effect.typical[0]
    for j in range(k):
        change = np.zeros(model.n_parameters)
        change[first + j] = step
        force = (
            model.sense(FULL.f_b, change, G, FULL.hold)
            - model.sense(FULL.f_b, -change, G, FULL.hold)
        ) / (2 * step)
        reading = (
            model.reading_errors(FULL.angles, change, FULL.hold)
            - model.reading_errors(FULL.angles, -change, FULL.hold)
        ) / (2 * step)
        rounding = 1e-14 * G / step
        assert np.abs(force).max() + np.abs(reading).max() > 100 * rounding
        np.testing.assert_allclose(shown.force[..., j], force, rtol=1e-6, atol=rounding)
        np.testing.assert_allclose(shown.angles[..., j], reading, rtol=1e-6, atol=rounding)


# --- what can be seen ----------------------------------------------------------------------------


def test_an_effect_is_judged_in_the_settings_that_a_diagnosis_tries():
    """A jump before the last holds, which point the same way, hardly shows; one in the middle does.

    What is excluded by the residuals and what they would show go together.
    """
    directions = shuffled("fibonacci-30")
    directions[-3:] = [[0, 0, 1], [0, 0.01, 1], [0.01, 0, 1]]
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    frame = design(directions, GRAVITY, some_holds(30), seed=1)
    rows = {row.name: row for row in visibilities(frame)}
    jump = rows["bias_jump"]
    tried = [h.effect.spec for h in frame.candidates["bias_jump"]]
    assert jump.easiest.spec in tried
    assert 600 < jump.easiest.settings["t"] < 1200
    limits = {limit.name: limit.value for limit in upper_limits(frame, True, ())}
    for name in ("bias_jump", "warm_up", "saturation"):
        assert rows[name].mdb < 3 * limits[name], name
    assert rows["bias_drift"].easiest.settings == {}


def test_the_limit_of_a_parameter_holds_where_no_noise_is_stated():
    """Noise of twice the unit, r = 5: a large parameter is beyond its limit in 2.5 % of all.

    That is when noise takes it down by more than half of its interval of 95 %.
    """
    rng = np.random.default_rng(5)
    frame = design(shuffled("fibonacci-14"), GRAVITY, some_holds(14), seed=1)
    residuals = frame.residuals
    assert residuals.redundancy == 5
    names = [n for n, shapes in frame.candidates.items() if {h.dim for h in shapes} == {1}]
    shape = frame.candidates[next(n for n in names if n != OUTLIER)][0]
    columns = frame.rows(shape.effect)
    size = 1000 / float(np.linalg.norm(residuals.project(columns)))
    short = 0
    shown = Candidates({shape.effect.name: Hypotheses.of([shape])}, (), {})
    for _ in range(n := 1500):
        errors = columns[:, 0] * size + 2 * rng.standard_normal(len(columns))
        changed = replace(frame, residuals=replace(residuals, errors=errors))
        vars(changed)["tested"] = shown
        (limit,) = upper_limits(changed, False, ())
        short += limit.value < size
    assert abs(short / n - 0.025) < 4.5 * np.sqrt(0.025 * 0.975 / n)


def test_a_sensor_whose_range_is_far_beyond_gravity_does_not_saturate():
    measured = campaign(3)
    assert "saturation" in examine_campaign(measured, NINE).candidates
    wide = examine_campaign(measured.with_header(range_mps2=8 * G), NINE)
    assert wide.tested.invisible == ("gravity_error", "saturation")
