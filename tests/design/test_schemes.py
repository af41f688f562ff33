"""Position schemes: what the literature and geometry say of them."""

from itertools import product

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from places import SHARED
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from accelstudy.schemes import Scheme, get_scheme, registry, scheme_families, scheme_names
from accelstudy.schemes.mclaren import mclaren_orbit

GENERIC = Rotation.from_euler("xyz", [15, 25, 35], degrees=True)
"""How schemes are turned whose axes of symmetry would hide something."""
# Neither symmetric nor of unit length; the last one is on the roll pole.
LOPSIDED = np.array([[0.0, 0.0, 2.0], [1.0, 0.0, 1.0], [3.0, 0.0, 0.0]])


def scheme(directions):
    return Scheme("test", "Test", directions, "generated", "test")


def angles(directions):
    """Angles between all pairs, rad."""
    i, j = np.triu_indices(len(directions), 1)
    cosine = np.einsum("ij,ij->i", directions[i], directions[j])
    return np.arccos(np.clip(cosine, -1, 1))


def condition(design):
    """Condition number of a design with columns scaled to unit length."""
    return np.linalg.cond(design / np.linalg.norm(design, axis=0))


def gravity_design(u):
    """Design of the nine parameters under the gravity norm, in units of g."""
    x, y, z = u.T
    return np.column_stack([u, u**2, x * y, x * z, y * z])


def sphere_moment(*powers):
    """Mean of x^a y^b z^c over the sphere."""
    if any(power % 2 for power in powers):
        return 0.0
    odd = [np.prod(np.arange(power - 1, 0, -2)) for power in (*powers, sum(powers) + 2)]
    return odd[0] * odd[1] * odd[2] / odd[3]


# The registry


def test_schemes_are_listed_by_their_size_beside_their_families():
    names = scheme_names()
    sizes = [get_scheme(name).n_positions for name in names]
    assert sizes == sorted(sizes)
    assert {*scheme_families()} >= {
        "antipodal-free-N", "d-optimal-N", "fibonacci-N", "i-optimal-N", "random-N",
        "random-N-SEED",
    }  # fmt: skip


@pytest.mark.parametrize("name", scheme_names())
def test_a_scheme_is_what_its_name_says(name):
    found = get_scheme(name)
    n = int(name.rsplit("-", 1)[1])
    assert found.name == name
    assert found.n_positions == n
    assert found.directions.shape == (n, 3)
    assert found.title.startswith(f"{n} ")
    assert found.source
    assert found.status in {"exact", "standard", "stand-in", "generated"}
    np.testing.assert_allclose(np.linalg.norm(found.directions, axis=1), 1, rtol=1e-14)


def test_rotation_is_about_fixed_axes():
    turned = scheme(LOPSIDED).rotated(np.radians([15, 25, 35]))
    expected = GENERIC.apply(scheme(LOPSIDED).directions.copy())
    np.testing.assert_allclose(turned.directions, expected, atol=1e-14)
    assert turned.name == "test-rotated"
    assert not turned.directions.flags.writeable


# Geometry


@pytest.mark.parametrize(("name", "separation", "edges", "m"), [
    ("faces-6", np.pi / 2, 12, 0),
    ("icosahedron-12", np.arccos(np.sqrt(1 / 5)), 30, 1 / 15),
    ("dodecahedron-20", np.arccos(np.sqrt(5) / 3), 30, 1 / 15),
    ("rhombicuboctahedron-24", np.arccos((3 + 2 * np.sqrt(2)) / (5 + 2 * np.sqrt(2))), 48, 0.0688),
    ("icosidodecahedron-30", np.pi / 5, 60, 1 / 15),
])  # fmt: skip
def test_polyhedra_have_their_edges(name, separation, edges, m):
    """And the fourth moment of the sphere, 1/15, where they have its symmetry."""
    found = angles(get_scheme(name).directions)
    assert found.min() == pytest.approx(separation)
    assert np.isclose(found, separation).sum() == edges
    assert get_scheme(name).fourth_moment == pytest.approx(m, abs=5e-5)


def test_faces_edges_and_corners_are_distinct_and_paired():
    for name in ("faces-6", "faces-edges-18", "faces-edges-corners-26"):
        directions = get_scheme(name).directions
        assert len(np.unique(directions.round(9), axis=0)) == len(directions)
        np.testing.assert_array_equal(directions[::2], -directions[1::2])
        np.testing.assert_array_equal(directions[0], [0, 0, 1])
        np.testing.assert_array_equal(directions[:6], get_scheme("faces-6").directions)


def test_mclaren_is_a_7_design():
    for directions in (mclaren_orbit(), get_scheme("mclaren-24").directions):
        for powers in product(range(8), repeat=3):
            if sum(powers) <= 7:
                moment = np.mean(np.prod(directions**powers, axis=1))
                assert moment == pytest.approx(sphere_moment(*powers), abs=1e-13), powers


def test_mclaren_is_the_turned_orbit_of_its_point():
    """Its positions are apart, and no two are opposite."""
    orbit = mclaren_orbit()
    point = np.array([0.2666354, 0.42251865, 0.86624682])
    np.testing.assert_allclose(np.sort(np.abs(orbit)), np.tile(point, (24, 1)), atol=5e-9)
    directions = get_scheme("mclaren-24").directions
    np.testing.assert_allclose(directions, GENERIC.apply(orbit), rtol=0, atol=1e-14)
    apart = np.degrees(angles(directions))
    assert apart.min() == pytest.approx(41.4, abs=0.05)
    assert apart.max() < 170


@pytest.mark.parametrize("name", ["mclaren-24", "dodecahedron-20", "icosidodecahedron-30"])
def test_generic_orientations_determine_cubic_terms_by_gravity(name):
    """An error k_i f_i³ changes the norm by k_i u_i⁴."""
    u = get_scheme(name).directions
    assert condition(np.hstack([gravity_design(u), u**4])) < 40
    assert np.degrees(get_scheme(name).pole_distance) > 9


@pytest.mark.parametrize(
    "name", [name for name in scheme_names() if get_scheme(name).n_positions > 17]
)
def test_orders_keep_a_drift_apart_from_the_parameters(name):
    """A linear drift of each bias, beside the 9 parameters (norm) and beside the affine ones."""
    u = get_scheme(name).directions
    time = np.linspace(-1, 1, len(u))[:, None]
    assert condition(np.hstack([gravity_design(u), time * u])) < 20
    assert condition(np.hstack([np.ones_like(time), u, time])) < 3


# Families


@given(n=st.integers(1, 300))
@settings(max_examples=25)
def test_fibonacci(n):
    found = get_scheme(f"fibonacci-{n}")
    assert found.n_positions == n
    np.testing.assert_allclose(np.linalg.norm(found.directions, axis=1), 1, rtol=1e-14)
    assert found.pole_distance == pytest.approx(np.arccos(1 - 1 / n))
    if n > 1:
        # Among n points on the sphere, two are at most about √(8 π / √3 / n) apart.
        assert angles(found.directions).min() * np.sqrt(n) > 2.5


@given(n=st.integers(2, 300))
@settings(max_examples=25)
def test_antipodal_free(n):
    directions = get_scheme(f"antipodal-free-{n}").directions
    between_axes = np.minimum(angles(directions), np.pi - angles(directions))
    assert between_axes.min() * np.sqrt(n) > 1


@example(n=38, seed=0)
@given(n=st.integers(1, 200), seed=st.integers(0, 10**18 - 1))
def test_random(n, seed):
    found = get_scheme(f"random-{n}-{seed}")
    assert found.n_positions == n
    assert found.title == f"{n} hand placed, seed {seed}"
    np.testing.assert_allclose(np.linalg.norm(found.directions, axis=1), 1, rtol=1e-14)
    registry._registered.cache_clear()
    np.testing.assert_array_equal(get_scheme(found.name).directions, found.directions)
    default = get_scheme(f"random-{n}").directions
    assert np.array_equal(found.directions, default) == (seed == 0)


def test_random_positions_are_faces_and_free_in_turn():
    directions = get_scheme("random-1200").directions
    to_face = np.degrees(np.arccos(np.abs(directions).max(axis=1)))
    assert np.sqrt(np.mean(to_face[::2] ** 2) / 2) == pytest.approx(2, rel=0.1)
    sides = directions[::2].round().reshape(100, 6, 3)
    for turn in sides:  # each face once
        np.testing.assert_array_equal(turn.sum(axis=0), 0)
        np.testing.assert_array_equal(np.abs(turn).sum(axis=0), 2)
    np.testing.assert_allclose(
        directions[1::2].T @ directions[1::2] / 600, np.eye(3) / 3, atol=0.05
    )


# The Xsens log


@pytest.fixture(scope="module")
def xsens_counts():
    path = SHARED / "data" / "imu_tk_xsens" / "derived_static_means.csv"
    if not path.exists():
        pytest.skip(f"needs {path}; set ACCELSTUDY_SHARED")
    table = np.genfromtxt(path, delimiter=",", names=True)
    return np.column_stack([table["ax"], table["ay"], table["az"]])


def test_xsens_directions_are_those_of_the_log(xsens_counts):
    g = 9.81744

    def force(parameters):
        offset, scale, (yz, zy, zx) = parameters[:3], parameters[3:6], parameters[6:]
        matrix = np.array([[1, -yz, zy], [0, 1, -zx], [0, 0, 1]])
        return (xsens_counts - 100 * offset) / scale @ matrix.T

    fit = least_squares(
        lambda parameters: np.linalg.norm(force(parameters), axis=1) - g,
        [331, 333, 324, 415, 415, 415, 0, 0, 0],
        x_scale="jac",
    )
    np.testing.assert_allclose(fit.x[3:6], [414.4143, 412.0467, 414.6139], atol=0.03)
    np.testing.assert_allclose(
        get_scheme("xsens-38").directions, scheme(-force(fit.x)).directions, atol=2e-5
    )
