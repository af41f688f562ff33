"""The same calibration in other gauges, and as a matrix for a device.

The norm of gravity determines K in f_b = K (f_s − b) only up to a rotation from the left. Authors
fix it by a triangular or a symmetric K; all have the same KᵀK and the same residuals.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from accelstudy.basics.units import STANDARD_GRAVITY
from accelstudy.effects import Effect
from accelstudy.sensors.models import compose
from accelstudy.sensors.sensor import SensorModel
from accelstudy.sensors.trace import trace_of
from accelstudy.symbolic.algebra import sp
from accelstudy.symbolic.tracing import derivative

Array = NDArray[np.float64]
Gauge = Literal["upper", "lower", "symmetric"]
GAUGES: tuple[Gauge, ...] = ("upper", "lower", "symmetric")


def in_gauge(matrix: ArrayLike, gauge: Gauge) -> Array:
    """Turn K (3, 3) into a gauge: the matrix R K, R a rotation, that is triangular or symmetric.

    The diagonal is positive. "upper" is the gauge of Thalmann & Neuner (2018, eq. 4).
    """
    k = np.asarray(matrix, dtype=float)
    gram = k.T @ k
    if gauge == "upper":
        return np.asarray(np.linalg.cholesky(gram).T)
    if gauge == "lower":
        # The Cholesky factor with rows and columns in reverse order.
        return np.asarray(np.linalg.cholesky(gram[::-1, ::-1]).T[::-1, ::-1])
    values, vectors = np.linalg.eigh(gram)
    return np.asarray((vectors * np.sqrt(values)) @ vectors.T)


def not_affine(model: SensorModel) -> tuple[str, ...]:
    """Names of the effects that no matrix can hold.

    Their output is not linear in the force, or depends on more than the force. Effects of the rig
    do not count.
    """
    return tuple(
        effect.name
        for effect in model.effects
        if effect.part == "sensor" and not _is_affine(type(effect))
    )


def _is_affine(kind: type[Effect]) -> bool:
    trace = trace_of((kind,))
    slopes = derivative(trace.h, trace.force).free_symbols
    used = set().union(*(sp.sympify(part).free_symbols for part in trace.h))
    conditions = {*trace.hold.values(), *trace.lagged.values()}
    return not (slopes & {*trace.force, trace.g} or used & conditions)


def affine_form(model: SensorModel, parameters: ArrayLike) -> tuple[Array, Array] | None:
    """K (3, 3) and b (3,) of f_b = K (f_s − b), or None if the model is not affine.

    Effects of the rig are left out: they are no part of the sensor.

    Parameters
    ----------
    model : SensorModel
    parameters : (u,) array, SI
    """
    if not_affine(model):
        return None
    specs = [effect.spec for effect in model.effects if effect.part == "sensor"]
    parameters = np.asarray(parameters, dtype=float)[..., model.stays]
    model = compose(model.name, tuple(specs))
    g = STANDARD_GRAVITY
    probes = g * np.concatenate([np.zeros((1, 3)), np.eye(3), -np.eye(3)])
    corrected = model.correct(probes, parameters)
    if not np.isfinite(corrected).all():
        return None
    matrix = ((corrected[1:4] - corrected[4:7]) / (2 * g)).T
    constant = corrected[0]
    return matrix, -np.linalg.solve(matrix, constant)
