"""A cause that nobody recorded: what is said where a thermometer or a clock is absent."""

import json
from dataclasses import replace

import numpy as np
import pytest
from diagnosis_helpers import GRAVITY, NINE, ROBOT, G, design, shuffled

from accelstudy.campaign.session import Campaign
from accelstudy.diagnosis.evidence import noise_models
from accelstudy.diagnosis.evidence.size import SIZE_WEIGHTS, SIZES, Evidence, Level, log_mean
from accelstudy.diagnosis.pipeline import diagnose
from accelstudy.diagnosis.report.document import diagnosis_document
from accelstudy.diagnosis.report.words import headline, verdict_lines

CANNOT = "slow noise, or an effect of temperature or time that these columns cannot tell"


def session(course, seed=1, n=40, size=6.0, robot=True, sigma=0.002, **columns):
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
    x, y, z = force = G * directions.T
    angles = np.column_stack([np.arctan2(-y, -z), np.arctan2(x, np.hypot(y, z))])
    read = 1.004 * force.T + [0.1, -0.05, 0.2] + moved + sigma * rng.standard_normal((n, 3))
    rig = {"angles": angles, "sigma_angle": 1e-6} if robot else {}
    columns = {"time": time, "sigma_force": sigma, **rig, **columns}
    return Campaign("wanders", np.arange(1, n + 1), read, G, **columns)


def wandering(t):
    """A course that is no drift, no warm-up and no step."""
    return np.sin(2 * np.pi * (0.9 * t + 0.2)) + 0.5 * np.sin(2 * np.pi * (2.3 * t + 0.1))


@pytest.mark.parametrize(("approach", "timed"), [(GRAVITY, True), (ROBOT, False)])
def test_a_smooth_course_has_the_likelihood_of_its_kernel(monkeypatch, approach, timed):
    """Against whole covariance matrices of squared-exponential kernels, biases and scales.

    Of lengths for which the sines stand for the kernel up to the ends of the session.
    """
    n, smooth = 24, (0.4, 0.25)
    monkeypatch.setattr(noise_models, "SMOOTH", smooth)
    examined = design(shuffled("mclaren-24"), approach, seed=5)
    residuals, forces = examined.frame.residuals, examined.frame.forces
    evidence = Evidence(Level.given(), residuals.redundancy)
    time = np.cumsum(np.random.default_rng(3).uniform(20, 60, n)) if timed else None
    t = np.linspace(-1, 1, n) if time is None else 2 * (time - time[0]) / np.ptp(time) - 1
    c = residuals.whitening.shape[1]
    space = np.linalg.svd(residuals.design)[0][:, residuals.design.shape[1] :]
    logs = []
    for scaled in (False, True):
        spread = np.zeros((len(residuals.design), 3, n))
        for i in range(n):
            part = residuals.force_noise[i] * (forces[i] if scaled else 1.0)
            spread[i * c : (i + 1) * c, :, i] = part
        for length in smooth:
            kernel = np.exp(-((t[:, None] - t) ** 2) / 2 / length**2)
            covariance = np.einsum("man,nk,lak->ml", spread, kernel, spread)
            values, vectors = np.linalg.eigh(space.T @ covariance @ space)
            values = np.maximum(values, 0) / values.sum()
            seen = (vectors.T @ space.T @ residuals.z) ** 2
            grown = 1 + SIZES[:, None] * values
            of_sizes = evidence.of_noise(np.sum(seen / grown, axis=1), np.log(grown).sum(axis=1))
            logs.append(log_mean(np.logaddexp.reduce(of_sizes, axis=-1), SIZE_WEIGHTS))
    found = noise_models.course_density(residuals, time, forces, evidence)
    assert found == pytest.approx(float(log_mean(np.array(logs))), abs=0.02)


@pytest.mark.parametrize(("robot", "columns"), [
    (True, {}), (False, {"sigma_force": None}), (True, {"time": None}),
])  # fmt: skip
def test_what_nobody_recorded_is_no_adequate_model(robot, columns):
    found = diagnose(session(wandering, robot=robot, **columns), NINE)
    assert found.verdict == "noise_model"
    assert found.found[0].name == "coloured_noise"
    said = " ".join(verdict_lines(found))
    assert headline(found).lower().startswith(CANNOT)
    assert "adequate" not in said
    assert "temperature at the sensor" in said
    assert ("time of each hold" in said) == ("time" in columns)
    assert CANNOT in json.dumps(diagnosis_document(found))


def test_a_course_that_a_thermometer_shows_is_an_effect():
    """The same session, with its temperature."""
    measured = session(wandering)
    t = measured.time / measured.time[-1]
    found = diagnose(replace(measured, temperature=20 + 3 * wandering(t)), NINE)
    assert (found.verdict, found.found[0].name) == ("named", "thermal_bias")
    assert not found.unrecorded
    assert found.coloured == 0


@pytest.mark.parametrize(("name", "course"), [
    ("bias_drift", lambda t: t),
    ("warm_up", lambda t: np.exp(-t / 0.12)),
    ("bias_jump", lambda t: 1.0 * (t > 0.44)),
])  # fmt: skip
def test_an_exact_form_keeps_its_name(name, course):
    """Its form fits better than a course that wanders, whatever nobody recorded."""
    found = diagnose(session(course, size=20.0, n=48), NINE)
    assert (found.verdict, found.found[0].name) == ("named", name)
    assert any("temperature was not recorded" in line for line in verdict_lines(found))
