"""Variance-based sensitivity of leveling: which inputs make roll and pitch uncertain.

Total effects by Sobol's method (SALib) over a grid of attitudes, for the forces alone (the
parameter-free model f_s = f_b + v, figure 4) and for the forces and all parameters of a calibrated
sensor model (figures 5 and 6 of Thalmann & Neuner 2018).

The total effect of an input is the share of the output's variance that would remain if all others
were known. The inputs are sampled independently, as classic indices assume; the parameters of a
calibration are correlated, which `accelstudy.leveling.shares` takes into account.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from itertools import product

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from accelstudy.basics.arrays import Array
from accelstudy.basics.shares import Z95
from accelstudy.basics.units import GON, MGON, STANDARD_GRAVITY
from accelstudy.leveling.angles import angles_of, specific_force, wrap_angle
from accelstudy.sensors.models import compose
from accelstudy.sensors.sensor import SensorModel

FORCES = ("f_x", "f_y", "f_z")
OUTPUTS = ("roll", "pitch")

FORCE_ALONE = compose("", ())
"""The model without parameters, whose output is the force itself."""
NEGLIGIBLE_VARIANCE = 1e-24
"""Variance in rad² below which an output does not vary: rounding, not an effect."""


def total_effects(
    function: Callable[[Array], Array],
    mean: ArrayLike,
    sigma: ArrayLike,
    base_samples: int,
    seed: int,
) -> tuple[Array, Array, Array]:
    """Total effects of independent normal inputs on the outputs of a function.

    They are those of Jansen's estimator, as SALib's `sobol.analyze` has them. Their intervals
    follow from the scatter of the squared differences that they are means of.

    Parameters
    ----------
    function : takes (N, d), d inputs, and returns (N, k)
    mean, sigma : (d,) arrays; inputs with sigma 0 have total effect 0
    base_samples : int, a power of two
    seed : int

    Returns
    -------
    total : (k, d) array; NaN where an output has no variance
    ci95 : (k, d) array, half width of its 95 % confidence interval
    sd : (k,) array, standard deviation of the outputs
    """
    mean, sigma = np.asarray(mean, dtype=float), np.asarray(sigma, dtype=float)
    varied = np.flatnonzero(sigma > 0)
    normal = _standard_normal(len(varied), base_samples, seed + 1)
    inputs = np.tile(mean, (len(normal), 1))
    inputs[:, varied] += sigma[varied] * normal
    outputs = function(inputs)
    found = np.zeros((2, outputs.shape[1], len(mean)))
    for k, values in enumerate(outputs.T):
        if values.var() <= NEGLIGIBLE_VARIANCE:
            found[:, k] = np.nan
            continue
        values = (values - values.mean()) / values.std()
        base, *mixed, other = values.reshape(base_samples, -1).T
        mean, variance = np.mean([base, other]), np.var([base, other])
        squares = 0.5 * (base - np.array(mixed)) ** 2 / variance
        total = squares.mean(axis=1)
        relative = ((base - mean) ** 2 + (other - mean) ** 2) / (2 * variance)
        scatter = np.std(squares - total[:, None] * relative, axis=1)
        found[:, k, varied] = total, Z95 * scatter / np.sqrt(base_samples)
    return found[0], found[1], outputs.std(axis=0)


@lru_cache(maxsize=1)  # the same at every attitude
def _standard_normal(d: int, base_samples: int, seed: int) -> Array:
    """Saltelli's samples of d standard normal inputs, (base_samples (d + 2), d)."""
    # Slow to import, and figures need only the names of this module.
    from SALib.sample import sobol

    names = [str(i) for i in range(d)]
    bounds, kinds = [[0.0, 1.0]] * d, ["norm"] * d
    problem = {"num_vars": d, "names": names, "bounds": bounds, "dists": kinds}
    samples = sobol.sample(problem, base_samples, calc_second_order=False, seed=seed)
    samples.flags.writeable = False
    return samples


def leveling_function(
    attitude: Array, model: SensorModel, g: float = STANDARD_GRAVITY
) -> Callable[[Array], Array]:
    """Return leveling near an attitude as a function of its uncertain inputs.

    Parameters
    ----------
    attitude : (2,) array, rad
    model : SensorModel
    g : float, m/s²

    Returns
    -------
    callable
        Takes (N, 3 + u), the sensor's output and the parameters of the model; returns roll and
        pitch less those of the attitude, (N, 2), rad, within half a turn.
    """

    def offset(inputs: Array) -> Array:
        force = model.correct(inputs[:, None, :3], inputs[:, 3:], g)[:, 0]
        return wrap_angle(angles_of(force) - attitude)

    return offset


def leveling_sensitivity(
    roll_gon: Sequence[float],
    pitch_gon: Sequence[float],
    sigma_force: float,
    base_samples: int,
    seed: int,
    model: SensorModel = FORCE_ALONE,
    parameters: ArrayLike = (),
    sigma_parameters: ArrayLike = (),
    g: float = STANDARD_GRAVITY,
) -> pd.DataFrame:
    """Total effects on roll and pitch over a grid of attitudes.

    Parameters
    ----------
    roll_gon, pitch_gon : the grid
    sigma_force : float, m/s², of each component of the sensor's output
    base_samples, seed : as in `total_effects`
    model, parameters, sigma_parameters : sensor model with its (u,) parameters and their sds, SI;
        without them the output is the force itself
    g : float, m/s²

    Returns
    -------
    DataFrame
        output, roll_gon, pitch_gon, input, total_effect, ci95, sd_output_mgon, defined; where the
        output has no variance the total effect is NaN and `defined` False.
    """
    names, x = [*FORCES, *model.parameter_names], np.asarray(parameters, dtype=float)
    sigma = np.concatenate([np.full(3, sigma_force), sigma_parameters])
    effects = []
    for roll, pitch in product(roll_gon, pitch_gon):
        attitude = np.array([roll * GON, pitch * GON])
        f_b = np.array(specific_force(attitude[0], attitude[1], g))
        mean = np.concatenate([model.sense(f_b[None], x, g)[0], x])
        of_inputs = leveling_function(attitude, model, g)
        effects.append(total_effects(of_inputs, mean, sigma, base_samples, seed))
    total, ci95, sd = (np.array(each) for each in zip(*effects, strict=True))
    return effects_table(roll_gon, pitch_gon, names, sd, {"total_effect": total, "ci95": ci95})


def effects_table(
    roll_gon: Sequence[float],
    pitch_gon: Sequence[float],
    names: Sequence[str],
    sd: Array,
    effects: Mapping[str, Array],
) -> pd.DataFrame:
    """Effects of d inputs on roll and pitch over a grid of a attitudes, a row each.

    Parameters
    ----------
    roll_gon, pitch_gon : the grid
    names : of the inputs
    sd : (a, 2) array, rad, of roll and of pitch
    effects : mapping of column to (a, 2, d) array; NaN where they are not defined
    """
    attitudes = [*product(map(float, roll_gon), map(float, pitch_gon))]
    rows = [(out, *at, name) for at in attitudes for out in OUTPUTS for name in names]
    table = pd.DataFrame(rows, columns=["output", "roll_gon", "pitch_gon", "input"])
    defined = np.isfinite(next(iter(effects.values()))).all(axis=2)
    return table.assign(
        **{column: each.ravel() for column, each in effects.items()},
        sd_output_mgon=np.repeat(sd.ravel() / MGON, len(names)),
        defined=np.repeat(defined.ravel(), len(names)),
    )
