"""Static holds in a log: where a sliding window varies no more than the noise of the sensor.

The detector is that of Tedaldi, Pretto and Menegatti (ICRA 2014): the norm of the variances of the
three axes in a window, against a threshold. The threshold comes from the data. The log is read
twice, first for the threshold, then for the holds, and only a piece of it is in memory at a time.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from accelstudy.campaign.allan import AllanDeviation, AllanSums
from accelstudy.campaign.logs import AXES, Log
from accelstudy.campaign.runs import runs_at_rest
from accelstudy.campaign.threshold import Threshold, choose_threshold, given_threshold, survey_log
from accelstudy.campaign.windows import samples_in
from accelstudy.campaign.wording import counted
from accelstudy.errors import InputError

Array = NDArray[np.float64]

_ALIKE = 1.5  # largest over smallest norm of the means of one sensor in gravity


@dataclass(frozen=True)
class Holds:
    """Static holds of a log, n of them, in order of time.

    Attributes
    ----------
    start, end : (n,) int arrays, first sample, and the one after the last
    t0, t1 : (n,) arrays, s, times of the first and of the last sample
    n_samples : (n,) int array
    mean, sd : (n, 3) arrays, m/s²
    threshold : Threshold
    window : int, samples in a window
    step : float, s, usual time between samples
    span : (float, float), s, first and last time in the log
    total : int, samples in the log that a window is centred at
    allan : AllanDeviation, of all holds together; channels: along the mean specific force of a
        hold, and twice across
    noise : (3,) array, m/s², root mean square sd of the samples within holds in these channels
    directed : bool, whether the means are near enough to forces for "along" to mean anything;
        counts without an offset are not
    warnings : tuple of str
    """

    start: NDArray[np.int_]
    end: NDArray[np.int_]
    t0: Array
    t1: Array
    n_samples: NDArray[np.int_]
    mean: Array
    sd: Array
    threshold: Threshold
    window: int
    step: float
    span: tuple[float, float]
    total: int
    allan: AllanDeviation
    noise: Array
    directed: bool
    warnings: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.start)

    def table(self) -> pd.DataFrame:
        """Table with one row for each hold."""
        columns: dict[str, NDArray[Any]] = {
            "start": self.start,
            "end": self.end,
            "t0_s": self.t0,
            "t1_s": self.t1,
            "n": self.n_samples,
        }
        columns |= {axis: self.mean[:, i] for i, axis in enumerate(AXES)}
        columns |= {f"sd_{axis}": self.sd[:, i] for i, axis in enumerate(AXES)}
        return pd.DataFrame(columns)


def find_holds(
    log: Log,
    *,
    window: float = 1.0,
    threshold: float | None = None,
    trim: float = 0.2,
    shortest: float = 1.0,
) -> Holds:
    """Find the static holds of a log.

    Parameters
    ----------
    log : Log
    window : float, s, length of the sliding window; a hold begins and ends half a window inside
        the samples at rest
    threshold : float, m/s², standard deviation of a window up to which it is at rest; chosen from
        the data if omitted
    trim : float, s, cut from both ends of a hold besides
    shortest : float, s, of what is left

    Raises
    ------
    InputError
        If the log cannot be read, is shorter than a window, or nothing in it is at rest.
    """
    width = samples_in(log, window)
    survey = survey_log(log, width)
    chosen = given_threshold(threshold) if threshold is not None else choose_threshold(survey, log)
    cut, least = round(trim / log.step), max(2, round(shortest / log.step))
    sums, found, spreads, saturated, short = AllanSums(), [], [], 0, 0
    for hold in runs_at_rest(log, width, chosen.sd**2, cut, survey.extremes):
        if hold.n < least:
            short += 1
        elif hold.saturated():
            saturated += 1
        else:
            turned = hold.release() @ _frame(hold.mean)
            sums.add(turned)
            spreads.append(turned.var(axis=0, ddof=1))
            found.append(hold)
    warnings = [*survey.warnings()]
    if saturated:
        warnings.append(f"{counted(saturated, 'hold')} left out: the sensor is saturated there")
    if not found:
        raise InputError(
            f"{log.path}: no static hold of {shortest:g} s or more "
            f"({counted(short, 'shorter one')}; a window is at rest up to {chosen.sd:.3g} m/s²)"
            + "".join(f"; {warning}" for warning in warnings)
        )
    return Holds(
        start=np.array([hold.start for hold in found]),
        end=np.array([hold.start + hold.n for hold in found]),
        t0=np.array([hold.t0 for hold in found]),
        t1=np.array([hold.t1 for hold in found]),
        n_samples=np.array([hold.n for hold in found]),
        mean=np.array([hold.mean for hold in found]),
        sd=np.array([np.sqrt(hold.squares / (hold.n - 1)) for hold in found]),
        threshold=chosen,
        window=width,
        step=log.step,
        span=survey.span,
        total=survey.total,
        allan=sums.deviation(log.step),
        noise=np.sqrt(np.mean(spreads, axis=0)),
        directed=_alike(np.linalg.norm([hold.mean for hold in found], axis=1)),
        warnings=tuple(warnings),
    )


def _frame(force: Array) -> Array:
    """Orthonormal columns, the first of them along `force`.

    A sensor that settles or is nudged turns a little; gravity then moves across the mean specific
    force, and along it only in the second order. What is left along it is the sensor's own noise.
    """
    size = float(np.linalg.norm(force))
    if size == 0:
        return np.eye(3)
    return np.linalg.svd(force[:, None] / size)[0]


def _alike(norms: Array) -> bool:
    """Whether the norms are all that of gravity but for an uncalibrated sensor's errors."""
    return bool(norms.max() <= _ALIKE * norms.min())
