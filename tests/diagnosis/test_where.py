"""Coordinates of functions without a name, and what repeats of attitudes tell."""

import numpy as np
from diagnosis_helpers import campaign
from scipy import stats
from usual import GRAVITY, NINE, G

from accelstudy.adjustment import Observations
from accelstudy.adjustment.quality import solve
from accelstudy.basics.units import GON
from accelstudy.diagnosis.pipeline import diagnose
from accelstudy.diagnosis.space.hypotheses import LackOfFit, clusters
from accelstudy.diagnosis.space.residuals import Residuals
from accelstudy.diagnosis.space.shapes import coordinate_in_holds
from accelstudy.diagnosis.visibility import examine_campaign
from accelstudy.schemes import get_scheme


def test_noise_lives_nowhere():
    assert diagnose(campaign(11)[0], NINE).like == ()


def test_coordinates_are_those_of_the_campaign():
    measured, _ = campaign()
    frame = examine_campaign(measured, NINE).frame
    for name, expected in {
        "time": measured.time,
        "temperature": measured.temperature,
        "vibration": measured.vibration,
        "yaw": measured.yaw,
        "angle": measured.angles,
        "move": np.diff(measured.angles, axis=0, prepend=measured.angles[:1]),
    }.items():
        off = coordinate_in_holds(name, frame) - np.reshape(expected, (measured.n_positions, -1))
        # An angle may be a whole turn away.
        assert np.abs((off / (400 * GON) + 0.5) % 1 - 0.5).max() < 1e-12 or not off.any(), name
    force = coordinate_in_holds("force", frame)
    np.testing.assert_array_equal(coordinate_in_holds("previous", frame)[1:], force[:-1])
    np.testing.assert_allclose(coordinate_in_holds("next", frame)[:-1], np.diff(force, axis=0))


# --- repeats ----------------------------------------------------------------------------------


def near(directions, degrees, rng):
    """Directions turned by up to so many degrees each, evenly over the cap."""
    across = rng.standard_normal(directions.shape)
    across -= np.sum(across * directions, axis=1, keepdims=True) * directions
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    angle = np.radians(degrees) * np.sqrt(rng.random((len(directions), 1)))
    return directions * np.cos(angle) + across * np.sin(angle)


def test_repeats_by_hand_count_and_the_lack_of_fit_keeps_its_level():
    """A person turns back to within two degrees."""
    rng, values = np.random.default_rng(17), []
    for _ in range(150):
        first = near(get_scheme("faces-edges-18").directions, 5, rng)
        taken = np.concatenate([first, near(first, 2, rng)])
        forces = -G * taken * [1.004, 0.997, 1.006] + [0.12, -0.08, 0.2]
        forces += 0.002 * rng.standard_normal(forces.shape)
        left = Residuals.of(solve(NINE, GRAVITY, Observations(forces[None], 0.002)))
        labels = clusters(forces)
        assert len(np.unique(labels)) == 18
        same = LackOfFit.of(left, labels)
        r, in_common, freedom = left.redundancy, float(same.parts(left.z)[0]), int(same.dims[0])
        of_repeats = float(left.z @ left.z) - in_common
        ratio = in_common / freedom / (of_repeats / (r - freedom))
        values.append(stats.f.sf(ratio, freedom, r - freedom))
    assert stats.kstest(values, "uniform").pvalue > 0.001
