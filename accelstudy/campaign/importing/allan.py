"""The Allan deviation, and how well it says the mean of a hold is known.

Samples of a real sensor are not independent, so the mean of n samples is less certain than their
standard deviation over √n. The Allan deviation at an averaging time τ measures the scatter of means
over τ for noise of any colour. For white noise both agree.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from accelstudy.basics.arrays import Array

MIN_DIFFERENCES = 10
"""Independent differences of neighbouring means that a trusted value needs (it is right to about
20 %)."""


@dataclass(frozen=True)
class AllanDeviation:
    """Allan deviation over averaging times.

    Attributes
    ----------
    tau : (k,) array, s
    deviation : (k, m) array, one column for each channel
    differences : (k,) int array, independent differences of neighbouring means behind each value
    """

    tau: Array
    deviation: Array
    differences: NDArray[np.int_]

    @property
    def pooled(self) -> Array:
        """Root mean square over the channels, (k,)."""
        return np.sqrt(np.mean(self.deviation**2, axis=1))


def pooled_deviation(
    records: Sequence[Array],
    step: float,
    frames: Sequence[Array] | Array | None = None,
    least: float = 1,
) -> AllanDeviation:
    """Allan deviation of all records of one sensor together; records may be short.

    Over m samples: σ²(τ) = ⟨(S[k + 2m] − 2 S[k + m] + S[k])²⟩ / (2 m²), S the running sum, and
    the mean over all k (overlapping estimate; IEEE Std 1139).

    Parameters
    ----------
    records : sequence of (n, c) arrays without gaps
    step : float, s, between samples
    frames : sequence of (c, d) arrays, optional
        For each record, to the columns of which its channels are turned.
    least : float, samples of the shortest averaging time
    """
    lengths = np.array([len(record) for record in records])
    factors = np.array([m for m in averaging_factors(lengths.max() // 2) if m >= least], dtype=int)
    channels = records[0].shape[1] if frames is None else frames[0].shape[1]
    squares = np.zeros((len(factors), channels))
    for i, record in enumerate(records):
        centred = record - record.mean(axis=0)
        centred[:, (record == record[:1]).all(axis=0)] = 0.0  # not what rounding the mean leaves
        turned = centred if frames is None else centred @ frames[i]
        for channel, values in enumerate(turned.T):
            sums = np.concatenate([[0.0], np.cumsum(values)])
            for at, m in enumerate(factors[2 * factors <= len(values)]):
                first = sums[m:] - sums[:-m]
                second = first[m:] - first[:-m]
                # BLAS would divide such short sums between threads that wait for each other.
                squares[at, channel] += np.einsum("i,i", second, second) / (2.0 * m**2)
    fits = lengths[:, None] >= 2 * factors
    terms = np.sum(fits * (lengths[:, None] + 1 - 2 * factors), axis=0)
    independent = np.sum(fits * (lengths[:, None] // factors - 1), axis=0)
    return AllanDeviation(
        step * factors.astype(float), np.sqrt(squares / terms[:, None]), independent
    )


def averaging_factors(largest: int) -> list[int]:
    """Numbers of samples averaged, four to the octave, from 1 to `largest`."""
    if largest < 1:
        return []
    steps = np.arange(np.floor(4 * np.log2(largest)) + 1)
    return [int(m) for m in np.unique(np.round(2.0 ** (steps / 4)).astype(int)) if m <= largest]


@dataclass(frozen=True)
class MeanAccuracy:
    """How well the mean over a hold is known.

    Attributes
    ----------
    duration : float, s, of the hold
    white : float, standard deviation of the mean for white noise: sd / √n
    allan : float, the same from the Allan deviation at `duration`
    tau : float, s, largest averaging time that the data determine
    slope : float, d log σ / d log τ by which `allan` was extrapolated from `tau` to `duration`;
        None if that was not necessary
    dof : float, degrees of freedom of the square of `allan`; of overlapping differences these
        are about as many as are independent (Greenhall & Riley 2003, flicker noise)
    """

    duration: float
    white: float
    allan: float
    tau: float
    slope: float | None
    dof: float

    @property
    def ratio(self) -> float:
        """Factor by which the assumption of white noise is too optimistic."""
        return self.allan / self.white if self.white > 0 else 1.0


def accuracy_of_mean(curve: AllanDeviation, duration: float, sd: ArrayLike, n: int) -> MeanAccuracy:
    """Standard deviation of a mean over `duration`, averaged over the channels.

    Beyond the largest averaging time with at least `MIN_DIFFERENCES` independent differences the
    curve is extrapolated with the slope of its last two octaves. The slope is kept between that of
    white noise (−1/2) and that of a random walk (+1/2).

    Parameters
    ----------
    curve : AllanDeviation
    duration : float, s
    sd : number or array, of the samples within a hold, of each channel
    n : int, samples in `duration`
    """
    white = float(np.sqrt(np.mean(np.square(sd)))) / np.sqrt(n)
    channels = curve.deviation.shape[1]
    usable = (curve.differences >= MIN_DIFFERENCES) & (curve.pooled > 0)
    if not usable.any():
        samples = int(curve.differences[0]) if len(curve.tau) else n - 1
        return MeanAccuracy(duration, white, white, 0.0, None, max(1.0, channels * samples))
    log_tau, log_sigma = np.log(curve.tau[usable]), np.log(curve.pooled[usable])
    tau, differences = float(np.exp(log_tau[-1])), channels * curve.differences[usable]
    if duration <= tau * (1 + 1e-9):
        allan = np.exp(np.interp(np.log(duration), log_tau, log_sigma))
        dof = np.interp(np.log(duration), log_tau, differences)
        return MeanAccuracy(duration, white, float(allan), tau, None, float(dof))
    last = log_tau >= log_tau[-1] - np.log(4.0) - 1e-9
    x, y, weight = log_tau[last], log_sigma[last], differences[last]
    slope, middle, beyond = -0.5, np.average(x, weights=weight), np.log(duration)
    if len(x) > 1:
        # The variance of log σ is proportional to one over the independent differences.
        slope = float(np.clip(np.polyfit(x, y, 1, w=np.sqrt(weight))[0], -0.5, 0.5))
    allan = float(np.exp(np.average(y - slope * x, weights=weight) + slope * beyond))
    # The variance of log σ² at the end of the line, 2/ν. The values within two octaves count as
    # three, as neighbouring ones share their differences; each has ν of flicker noise, which is
    # near the number of differences. A slope that is that of white noise has no error.
    variance = 1 / np.sum(weight)
    if slope > -0.5:
        variance += (beyond - middle) ** 2 / np.sum(weight * (x - middle) ** 2)
    dof = min(1.0, 3 / len(x)) / variance
    return MeanAccuracy(duration, white, allan, tau, slope, max(1.0, float(dof)))
