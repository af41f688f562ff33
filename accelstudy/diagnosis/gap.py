"""Whether a named effect helps where it was neither chosen nor fitted: on held-out positions.

Base model and extended model are fitted to some positions and predict the others. With r the
misclosures of unit weight that the base model leaves there, A₂ their derivatives, C the cofactors
of the base parameters and d = r − r' the correction that the extended model makes,

    z = dᵀr / √(dᵀ (I + A₂ C A₂ᵀ) d)

is standard normal if the base model is complete, whatever effect was chosen on the fitted
positions.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from accelstudy.adjustment import Observations, calibrate
from accelstudy.adjustment.calibration import CalibrationProblem
from accelstudy.approaches import Approach
from accelstudy.effects import Hold
from accelstudy.sensor import SensorModel

Array = NDArray[np.float64]

HELD_OUT = 1 / 3
"""Share of the positions that is held out."""
SPLITS = 300
RESAMPLES = 1000
SIGNIFICANT = 1.645
"""One-sided 5 % of the standard normal distribution."""


@dataclass(frozen=True)
class HeldOutGap:
    """Evidence from held-out positions, in units of the noise variance.

    Attributes
    ----------
    before, after : float, mean square of the misclosures of the base and of the extended model
    floor : float, what it would be with the right model
    reduction_ci95 : (float, float), of before − after, over resampled positions
    z : float
    held : tuple of int, indices of the held-out positions
    """

    before: float
    after: float
    floor: float
    reduction_ci95: tuple[float, float]
    z: float
    held: tuple[int, ...]

    @property
    def significant(self) -> bool:
        """Whether the correction is right at 5 %."""
        return self.z > SIGNIFICANT


def split_positions(
    forces: Array, hold: Hold, count: int, rng: np.random.Generator
) -> tuple[NDArray[np.int_], NDArray[np.int_]]:
    """Split positions into fitted and held-out ones, alike in direction, time and temperature.

    Of many random splits the one whose two parts agree best in the first and second moments is
    taken. It looks at where and when was measured, never at what.

    Parameters
    ----------
    forces : (n, 3) array, of an ideal sensor
    hold : Hold
    count : int, positions to hold out
    rng : Generator
    """
    n = len(forces)
    unit = forces / np.linalg.norm(forces, axis=1, keepdims=True)
    columns = [*unit.T, *(unit[:, i] * unit[:, j] for i in range(3) for j in range(i + 1))]
    for values in (hold.time, hold.temperature, hold.vibration):
        if values is not None and np.ptp(values) > 0:
            scaled = (values - np.mean(values)) / np.std(values)
            columns += [scaled, scaled**2]
    features = np.column_stack(columns)
    scale = features.std(axis=0)
    features = (features - features.mean(axis=0)) / np.where(scale > 0, scale, 1.0)
    orders = np.array([rng.permutation(n) for _ in range(SPLITS)])
    # The means of the two parts differ in proportion to the sum over either.
    imbalance = np.sum(features[orders[:, :count]].sum(axis=1) ** 2, axis=1)
    best = orders[int(np.argmin(imbalance))]
    return np.sort(best[count:]), np.sort(best[:count])


def held_out_gap(
    base: SensorModel,
    extended: SensorModel,
    approach: Approach,
    observed: Observations,
    fitted: NDArray[np.int_],
    held: NDArray[np.int_],
    variance: float | None,
    rng: np.random.Generator,
) -> HeldOutGap | None:
    """Fit both models to some positions and predict the others.

    Parameters
    ----------
    base, extended : SensorModel
    approach : Approach
    observed : Observations, of all positions
    fitted, held : indices of positions
    variance : float, of unit weight; None takes that of the extended fit
    rng : Generator, for the resampling

    Returns
    -------
    HeldOutGap, or None if a model cannot be fitted to these positions.
    """
    part, rest = observed.take(fitted), observed.take(held)
    results = []
    for model in (base, extended):
        initial = None
        if observed.initial is not None:
            start = dict(zip(base.parameter_names, observed.initial, strict=True))
            initial = model.vector(start)
        result = calibrate(model, approach, replace(part, initial=initial))
        if not result.converged[0] or result.redundancy <= 0:
            return None
        results.append((model, result))
    if variance is None:
        variance = float(results[1][1].variance_posteriori[0])
    predictions = [
        _predict(model, approach, rest, result.parameters[0]) for model, result in results
    ]
    (r, a), (r_after, a_after) = predictions
    n_conditions = approach.n_conditions
    c, c_after = (result.cofactors[0] for _, result in results)
    d = r - r_after
    size = float(d @ d + (d @ a) @ c @ (a.T @ d))
    before, after = (x.reshape(-1, n_conditions) ** 2 / variance for x in (r, r_after))
    gain = np.sum(before - after, axis=1) / n_conditions
    chosen = rng.integers(len(gain), size=(RESAMPLES, len(gain)))
    low, high = np.quantile(gain[chosen].mean(axis=1), [0.025, 0.975])
    return HeldOutGap(
        before=float(before.mean()),
        after=float(after.mean()),
        floor=float(1 + np.einsum("mu,uv,mv->", a_after, c_after, a_after) / len(r)),
        reduction_ci95=(float(low), float(high)),
        z=float(d @ r / np.sqrt(size * variance)) if size > 0 else 0.0,
        held=tuple(int(i) for i in held),
    )


def _predict(
    model: SensorModel, approach: Approach, observed: Observations, parameters: Array
) -> tuple[Array, Array]:
    """Misclosures of unit weight of unused positions, and their derivatives."""
    problem = CalibrationProblem.of(model, approach, replace(observed, initial=None))
    p = parameters[: model.n_parameters]
    g = float(parameters[-1]) if problem.weights.any() else float(np.ravel(observed.gravity)[0])
    f_a = model.sensitive_force(observed.forces, p, g, observed.hold)
    at = problem.conditions.linearise(
        parameters[:, None],
        np.moveaxis(problem.observations, -1, 0),
        np.moveaxis(f_a, -1, 0),
    )
    b = np.moveaxis(at.jac_observations[:, :, 0], -1, 0)
    lower = np.linalg.cholesky(np.einsum("nco,no,ndo->ncd", b, problem.cofactors, b))
    r = np.linalg.solve(lower, at.psi[:, 0].T[..., None]).ravel()
    a = np.linalg.solve(lower, np.moveaxis(at.jac_parameters[:, :, 0], -1, 0))
    return np.asarray(r), np.asarray(a.reshape(len(r), -1))
