"""A cause that nobody recorded: what is said where a thermometer or a clock is absent."""

import json

import numpy as np
import pytest
from campaign_helpers import made
from closed_forms import roll_and_pitch
from usual import NINE, G

from accelstudy.diagnosis.pipeline import diagnose
from accelstudy.diagnosis.report.output import Diagnosis
from accelstudy.diagnosis.report.words import verdict_lines

CANNOT = (
    "noise that is slow or differs from hold to hold, or an effect of temperature or time that "
    "these columns cannot show"
)


def session(course, seed=1, n=40, size=6.0, robot=True, sigma=0.002, stated=True, **columns):
    """A session of own formulas: an affine sensor whose biases follow a course of the time.

    Parameters
    ----------
    course : function of the time from 0 to 1, with values of about one
    size : float, change of the biases in sigmas
    columns : of the campaign, beside the time, which is there unless it is None
    """
    rng = np.random.default_rng([17, seed])
    directions = rng.standard_normal((n, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    time = 40.0 * np.arange(n) + rng.uniform(0, 10, n)
    moved = size * sigma * course(time / time[-1])[:, None] * np.array([1.0, -0.7, 0.5])
    force = G * directions
    read = 1.004 * force + [0.1, -0.05, 0.2] + moved + sigma * rng.standard_normal((n, 3))
    rig = {"angles": roll_and_pitch(force), "sigma_angle": 1e-6} if robot else {}
    return made(read, G, sigma if stated else None, **{"time": time, **rig, **columns})


def wandering(t):
    """A course that is no drift, no warm-up and no step."""
    return np.sin(2 * np.pi * (0.9 * t + 0.2)) + 0.5 * np.sin(2 * np.pi * (2.3 * t + 0.1))


@pytest.mark.parametrize(("robot", "columns"), [
    (True, {}), (False, {"stated": False}), (True, {"time": None}),
])  # fmt: skip
def test_what_nobody_recorded_is_a_function_of_time(robot, columns):
    """Not noise: with the function in the model the sensor levels as the noise allows."""
    found = diagnose(session(wandering, robot=robot, **columns), NINE)
    assert (found.verdict, found.shape.place) == ("learned", ("time", "bias"))
    assert any("campaign has no temperature" in line for line in verdict_lines(found))
    _, before, after = found.leveling
    assert after < before / 2


def test_where_it_may_be_slow_noise_as_well_nothing_is_learned():
    found = diagnose(session(wandering, seed=2), NINE)
    assert (found.verdict, found.reason.code) == ("unknown", "unrecorded")
    said = " ".join(verdict_lines(found))
    assert verdict_lines(found)[0].lower().startswith(CANNOT)
    assert "adequate" not in said
    assert "temperature at the sensor" in said
    assert "time of each hold" not in said
    assert CANNOT in json.dumps(Diagnosis(found).content)
    without_time = diagnose(session(wandering, seed=2, size=2.0, time=None), NINE)
    assert "time of each hold" in " ".join(verdict_lines(without_time))


def test_a_course_that_a_thermometer_shows_is_an_effect():
    """The same session, with its temperature."""
    measured = session(wandering)
    t = measured.time / measured.time[-1]
    found = diagnose(measured.with_arrays(temperature=20 + 3 * wandering(t)), NINE)
    assert (found.verdict, found.found[0].name) == ("named", "thermal_bias")
    assert found.reason.code != "unrecorded"
    assert found.p_coloured == 0


@pytest.mark.parametrize(("name", "course"), [
    ("bias_drift", lambda t: t),
    ("warm_up", lambda t: np.exp(-t / 0.12)),
    ("bias_jump", lambda t: 1.0 * (t > 0.44)),
])  # fmt: skip
def test_an_exact_form_keeps_its_name(name, course):
    """Its form fits better than a course that wanders, whatever nobody recorded."""
    found = diagnose(session(course, size=20.0, n=48), NINE)
    assert (found.verdict, found.found[0].name) == ("named", name)
    assert any("campaign has no temperature" in line for line in verdict_lines(found))
