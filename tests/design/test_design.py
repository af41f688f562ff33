"""What a scheme can determine: ranks, conditions, reasons, and the numbers of linear theory."""

import numpy as np
import pytest
from closed_forms import gravity_sigma, has_octahedral_moments, perfect_robot_ratio
from usual import BOTH, GRAVITY, NINE, ROBOT, TWELVE

from accelstudy.adjustment import calibrate
from accelstudy.design.estimability import estimability
from accelstudy.schemes import get_scheme, scheme_names
from accelstudy.sensors.models import get_model
from accelstudy.simulation.sessions import Noise, session

QUADRATIC = get_model("bias-scale-nonorthogonality-quadratic")
# bias (m/s²), scale, non-orthogonality (rad) in the order of the parameters
KINDS = {"bias": slice(0, 3), "scale": slice(3, 6), "nonorthogonality": slice(6, 9)}


def design(scheme, model=NINE, approach=GRAVITY, **more):
    scheme = get_scheme(scheme) if isinstance(scheme, str) else scheme
    return estimability(scheme, model, approach, **more)


# --- ranks and reasons ---------------------------------------------------------------------------


def test_six_faces_determine_six_parameters_without_redundancy():
    found = design("faces-6", get_model("bias-scale"))
    assert found.estimable
    assert found.reason == ""
    assert (found.rank, found.redundancy) == (6, 0)
    assert found.condition == pytest.approx(1)


@pytest.mark.parametrize("scheme", scheme_names())
def test_gravity_is_blind_to_rotations_and_a_robot_is_not(scheme):
    """Nine parameters need more than faces, and quadratic terms twelve positions."""
    found = design(scheme, TWELVE)
    assert found.rank == (6 if scheme == "faces-6" else 9)
    assert found.not_estimable == TWELVE.parameter_names[6:]
    assert "gravity approach in any scheme" in found.reason
    assert design(scheme, TWELVE, ROBOT).estimable
    assert design(scheme).estimable is (scheme != "faces-6")
    assert design(scheme, QUADRATIC).estimable is (scheme not in ("faces-6", "d-optimal-9"))


# --- linear theory -------------------------------------------------------------------------------


@BOTH
@pytest.mark.parametrize("scheme", ["mclaren-24", "faces-edges-18", "rings-24"])
@pytest.mark.parametrize("noise", [Noise(), Noise(sigma_gravity=1e-3)], ids=["fixed g", "sigma g"])
def test_sigma_is_that_of_the_adjustment(scheme, approach, noise):
    ideal = session(NINE, np.zeros(9), get_scheme(scheme).directions)
    result = calibrate(NINE, approach, ideal.observations(noise))
    found = design(scheme, approach=approach, noise=noise)
    np.testing.assert_allclose(found.sigma, result.sigma_priori[0], rtol=1e-7)
    np.testing.assert_allclose(found.cofactors, result.cofactors[0], rtol=0, atol=1e-14)


OCTAHEDRAL = ["mclaren-24", "faces-edges-18", "rings-24", "rhombicuboctahedron-24"]


@pytest.mark.parametrize("scheme", OCTAHEDRAL)
def test_closed_forms_of_the_gravity_based_calibration(scheme):
    directions = get_scheme(scheme).directions
    assert has_octahedral_moments(directions)
    found = design(scheme)
    for kind, sigma in gravity_sigma(directions, 0.002).items():
        np.testing.assert_allclose(found.sigma[KINDS[kind]], sigma, rtol=1e-9)
    correlation = found.cofactors / np.outer(found.sigma, found.sigma)
    expected, m = np.eye(9), float(np.mean(directions[:, 0] ** 2 * directions[:, 1] ** 2))
    expected[3:6, 3:6] += -3 * m / (1 - 3 * m) * (1 - np.eye(3))
    np.testing.assert_allclose(correlation, expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize("scheme", OCTAHEDRAL)
def test_closed_forms_of_a_perfect_robot(scheme):
    noise = Noise(sigma_angle=0.0)
    ratio = design(scheme, approach=ROBOT, noise=noise).sigma / design(scheme, noise=noise).sigma
    for kind, expected in perfect_robot_ratio(get_scheme(scheme).directions).items():
        np.testing.assert_allclose(ratio[KINDS[kind]], expected, rtol=1e-9)
