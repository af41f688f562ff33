"""Positions that minimise the variances of the nine parameters, or of leveling with them."""

from typing import Literal

import numpy as np

from accelstudy.errors import InputError
from accelstudy.schemes.fibonacci import fibonacci
from accelstudy.schemes.registry import Array, register

Criterion = Literal["D", "I"]

# Mean squared error of the leveled direction over the sphere, as a quadratic form in the errors
# of bias / g, scale and the triangular non-orthogonality: the part of b + E u across u, where a
# common scale error does not count.
LEVELING_WEIGHT = np.zeros((9, 9))
LEVELING_WEIGHT[:3, :3] = np.eye(3) * 2 / 3
LEVELING_WEIGHT[3:6, 3:6] = np.eye(3) / 5 - np.ones((3, 3)) / 15
LEVELING_WEIGHT[6:, 6:] = np.eye(3) * 4 / 15

_PAIRS = np.array([[0, 1], [0, 2], [1, 2]])


@register(
    "d-optimal-9",
    title="D-optimal",
    status="stand-in",
    source="extremal points of degree 2, Sloan & Womersley (2004), Adv. Comput. Math. 21, "
    "107-125, for the 9 positions of Zhang et al. (2010), Meas. Sci. Technol. 21, 015107",
)
def d_optimal_9() -> Array:
    """As many positions as parameters, of the largest determinant there is; redundancy 0.

    They are a triangular prism with a cap on each side. With triangles of radius r and caps of
    radius 1 the determinant is proportional to (1-r)^5 (1+r)^9 r^8, which 11 r² - 2 r - 4 = 0
    maximises. A rotation leaves it alone: the prism stands along x, 44° off the roll pole.
    """
    r = (1 + 3 * np.sqrt(5)) / 11
    x = np.sqrt(1 - r**2)
    angle = np.radians([0, 120, 240])
    triangle = np.column_stack([np.zeros(3), np.sin(angle), np.cos(angle)])
    return np.vstack([triangle, [x, 0, 0] - r * triangle, [-x, 0, 0] - r * triangle])


@register("d-optimal-N", title="D-optimal", status="generated", source="optimal_directions")
def d_optimal(n: int) -> Array:
    """The n positions of the largest determinant."""
    return optimal_directions(n, "D")


@register("i-optimal-N", title="I-optimal", status="generated", source="optimal_directions")
def i_optimal(n: int) -> Array:
    """The n positions of the best leveling."""
    return optimal_directions(n, "I")


def optimal_directions(n: int, criterion: Criterion = "D", starts: int = 8) -> Array:
    """Optimal positions for a calibration by the norm of gravity.

    Parameters
    ----------
    n : int
        Number of positions, at least 9.
    criterion : {"D", "I"}
        What to minimise, see `design_criterion`.
    starts : int
        Number of starting values: the Fibonacci lattice and `starts` - 1 random sets.

    Returns
    -------
    ndarray, shape (n, 3)
        Unit vectors. From 16 positions on D-optimal sets are many, all as good as the sphere.

    Raises
    ------
    InputError
        If n is less than the number of parameters.
    """
    from scipy.optimize import minimize  # slow to import, and only optimal schemes need it

    if n < 9:
        raise InputError(f"9 parameters need at least 9 positions, not {n}")
    rng = np.random.default_rng(np.random.SeedSequence(n))
    best, smallest = np.empty((n, 3)), np.inf
    for start in range(starts):
        first = rng.standard_normal((n, 3)) if start else fibonacci(n)
        found = minimize(_on_sphere, first.ravel(), (criterion,), "L-BFGS-B", jac=True)
        # Where optima tie, rounding must not choose between them.
        if found.fun < smallest - 1e-6 * (1 + abs(found.fun)):
            best, smallest = found.x.reshape(n, 3), found.fun
    return best / np.linalg.norm(best, axis=1, keepdims=True)


def gravity_design(directions: Array) -> Array:
    """Design matrix of the nine-parameter model under the gravity norm, in units of g.

    Parameters
    ----------
    directions : ndarray, shape (n, 3)
        Unit vectors u; their sign is that of the bias only.

    Returns
    -------
    ndarray, shape (n, 9)
        u_i of the biases, u_i² of the scale errors, u_i u_j of the non-orthogonalities.
    """
    i, j = _PAIRS.T
    return np.hstack([directions, directions**2, directions[:, i] * directions[:, j]])


def design_criterion(directions: Array, criterion: Criterion = "D") -> float:
    """What an optimal design minimises.

    Parameters
    ----------
    directions : ndarray, shape (n, 3)
        Unit vectors, a design of full rank.
    criterion : {"D", "I"}
        D: the log-determinant of the cofactor matrix of the nine parameters. I: the log of the
        mean cofactor of a leveled direction, over all attitudes.

    Returns
    -------
    float
    """
    return _value_and_gradient(directions, criterion)[0]


def _value_and_gradient(directions: Array, criterion: Criterion) -> tuple[float, Array]:
    design = gravity_design(directions)
    cofactor = np.linalg.inv(design.T @ design)
    if criterion == "D":
        value = float(np.linalg.slogdet(cofactor)[1])
        by_design = -2 * design @ cofactor
    else:
        trace = np.sum(LEVELING_WEIGHT * cofactor)
        value = float(np.log(trace))
        by_design = -2 * design @ cofactor @ LEVELING_WEIGHT @ cofactor / trace
    gradient = by_design[:, :3] + 2 * directions * by_design[:, 3:6]
    for column, (i, j) in enumerate(_PAIRS, start=6):
        gradient[:, i] += by_design[:, column] * directions[:, j]
        gradient[:, j] += by_design[:, column] * directions[:, i]
    return value, gradient


def _on_sphere(coordinates: Array, criterion: Criterion) -> tuple[float, Array]:
    """Value and gradient in coordinates that are free because their length does not count."""
    points = coordinates.reshape(-1, 3)
    length = np.linalg.norm(points, axis=1, keepdims=True)
    directions = points / length
    value, gradient = _value_and_gradient(directions, criterion)
    radial = np.sum(gradient * directions, axis=1, keepdims=True)
    return value, ((gradient - radial * directions) / length).ravel()
