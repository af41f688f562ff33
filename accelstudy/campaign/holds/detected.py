"""The static holds of a log: what is known of each, and of the noise of all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError
from accelstudy.campaign.holds.allan import AllanDeviation, AllanSums, accuracy_of_mean
from accelstudy.campaign.holds.segments import Segment
from accelstudy.campaign.holds.threshold import Threshold
from accelstudy.campaign.holds.windows import Envelope
from accelstudy.campaign.logs.recording import Recording
from accelstudy.leveling.angles import usual_norm

Array = NDArray[np.float64]

_ALIKE = 1.5  # largest over smallest norm of the means of one sensor in gravity
_SPREAD = 0.25  # rms of the means along their thinnest direction, over gravity; of a sphere 0.58
SHARE = 8.0
"""Length of a hold over the longest averaging time that its residuals about a line are used for."""


@dataclass(frozen=True)
class HoldNoise:
    """Noise of the samples within all holds of a log together, in three channels.

    The first channel is along the mean specific force of a hold, the other two are across it.

    Attributes
    ----------
    allan : AllanDeviation, of the channels
    sd : (3,) array, m/s², root mean square sd of the samples within holds in the channels
    center : (3,) array, m/s², zero point of the specific forces; zero if the holds determine none
    directed : bool, whether the means are close enough to forces for "along" to have a meaning
    """

    allan: AllanDeviation
    sd: Array
    center: Array
    directed: bool

    @property
    def of_sensor(self) -> slice:
        """Channels with the noise of the sensor: those without what moves it, if there are any."""
        return slice(0, 1) if self.directed else slice(0, 3)


@dataclass(frozen=True)
class DetectedHolds:
    """Static holds of a log, n of them, in order of time.

    Attributes
    ----------
    segments : mapping of int to Segment, by the numbers that figures and options use
    left_out : mapping of int to str, numbers of holds that are left out, with the reason
    conditions : mapping of "temperature" and "vibration" to (n,) arrays, °C (mean) and m/s² (rms);
        NaN where nothing is known
    noise : HoldNoise, of the holds that are not left out
    threshold : Threshold
    step : float, s, usual time between samples
    envelope : Envelope, of the log, for its figure
    warnings : tuple of str
    """

    segments: Mapping[int, Segment]
    left_out: Mapping[int, str]
    conditions: Mapping[str, Array]
    noise: HoldNoise
    threshold: Threshold
    step: float
    envelope: Envelope
    warnings: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.segments)

    def of_each(self, attribute: str) -> NDArray[Any]:
        """Attribute of `Segment` for each hold, (n,) or (n, 3)."""
        return np.array([getattr(segment, attribute) for segment in self.segments.values()])

    @property
    def number(self) -> NDArray[np.int_]:
        """Numbers of the holds, (n,)."""
        return np.array(list(self.segments))

    @property
    def used(self) -> NDArray[np.bool_]:
        """Which holds are not left out, (n,)."""
        return ~np.isin(self.number, list(self.left_out))

    @property
    def t0(self) -> Array:
        """Times of the first samples since the first of the log, (n,), s."""
        return self.of_each("t0")

    @property
    def t1(self) -> Array:
        """Times of the last samples, (n,), s."""
        return self.of_each("t1")

    @property
    def n_samples(self) -> NDArray[np.int_]:
        """Numbers of samples, (n,)."""
        return self.of_each("n")

    @property
    def mean(self) -> Array:
        """Mean specific forces, (n, 3), m/s²."""
        return self.of_each("mean")

    @property
    def radius(self) -> float:
        """Usual distance of the means from the zero point of the specific forces, m/s²."""
        return usual_norm(self.mean - self.noise.center)

    def slope_sigmas(self) -> Array:
        """Standard deviations of the slopes of the samples, (n, 3), m/s²/s."""
        return slope_sigmas(list(self.segments.values()), self.step)


def collected(
    segments: Mapping[int, Segment],
    left_out: Mapping[int, str],
    log: Recording,
    threshold: Threshold,
    envelope: Envelope,
    warnings: Sequence[str],
) -> DetectedHolds:
    """Collect the segments of a sensor.

    Raises
    ------
    InputError
        If all holds are left out.
    """
    used = [segment for number, segment in segments.items() if number not in left_out]
    if not used:
        raise InputError(f"{log.path}: exclude: no hold is left")
    return DetectedHolds(
        segments=segments,
        left_out=left_out,
        conditions=_conditions(list(segments.values()), log.conditions),
        noise=_noise(used, log.step),
        threshold=threshold,
        step=log.step,
        envelope=envelope,
        warnings=tuple(warnings),
    )


def _noise(segments: Sequence[Segment], step: float) -> HoldNoise:
    """Turn the samples of each hold to its channels, and add them up."""
    center, directed = _center(np.array([segment.mean for segment in segments]))
    sums, variances = AllanSums(), []
    for segment in segments:
        frame = _frame(segment.mean - center)
        for record in segment.noise:
            sums.add(record, frame)
        variances.append(np.diag(frame.T @ segment.covariance @ frame))
    sd = np.sqrt(np.mean(variances, axis=0))
    return HoldNoise(sums.deviation(step), sd, center, directed)


def _conditions(segments: Sequence[Segment], names: Sequence[str]) -> dict[str, Array]:
    """Mean temperature and rms vibration of holds."""
    count, total, squares = np.array([s.conditions for s in segments]).transpose(1, 0, 2)
    with np.errstate(invalid="ignore", divide="ignore"):
        values = {"temperature": total / count, "vibration": np.sqrt(squares / count)}
    return {name: values[name][:, i] for i, name in enumerate(names)}


def _center(means: Array) -> tuple[Array, bool]:
    """Point from which all means of holds are equally far, and whether there is one.

    The offset of counts may be unknown; with a large one no mean points along gravity. If the
    attitudes differ enough, the sphere through the means shows it.
    """
    centers = [np.zeros(3)]
    if len(means) > 5 and (sphere := fit_sphere(means)) is not None:
        center, radius = sphere
        thinnest = np.linalg.svd(means - means.mean(axis=0), compute_uv=False)[-1]
        if thinnest > _SPREAD * radius * np.sqrt(len(means)):
            centers.insert(0, center)
    for center in centers:
        norms = np.linalg.norm(means - center, axis=1)
        if norms.max() <= _ALIKE * norms.min():
            return center, True
    return np.zeros(3), False


def _frame(force: Array) -> Array:
    """Orthonormal columns, the first of them along `force`.

    A sensor that settles or is nudged turns a little. That moves the force across its mean, and
    along it in the second order only. So the scatter along the mean is the sensor's own noise.
    """
    size = float(np.linalg.norm(force))
    if size == 0:
        return np.eye(3)
    return np.linalg.svd(force[:, None] / size)[0]


def slope_sigmas(segments: Sequence[Segment], step: float) -> Array:
    """Standard deviations of the slopes of the axes in holds, (n, 3), m/s²/s.

    The slope over a time T depends on the difference between its two halves. For white noise the
    least-squares slope has σ = √6 σ_A(T/2) / T with the Allan deviation σ_A; for flicker noise and
    a random walk this is right within some 10 %.

    σ_A is that of the residuals about the line of each hold, over all holds together, so that
    slopes do not count as noise. Since the line also absorbs the slowest noise, a hold contributes
    only averaging times up to an eighth of its length. Longer ones come from longer holds, or are
    extrapolated.

    Parameters
    ----------
    segments : sequence of Segment
    step : float, s, between samples
    """
    sums = AllanSums()
    for segment in segments:
        for record in segment.wobble:
            sums.add(record.up_to(segment.n / SHARE))
    curve = sums.deviation(step)
    variances = np.mean([np.diag(segment.covariance) for segment in segments], axis=0)
    sigma = np.empty((len(segments), 3))
    for i, segment in enumerate(segments):
        for axis in range(3):
            half = accuracy_of_mean(
                curve.channels(slice(axis, axis + 1)),
                segment.n * step / 2,
                float(np.sqrt(variances[axis])),
                max(1, segment.n // 2),
            )
            sigma[i, axis] = np.sqrt(6.0) * half.allan / (segment.n * step)
    return sigma


def fit_sphere(forces: Array) -> tuple[Array, float] | None:
    """Centre (3,) and radius of the sphere that fits points (n, 3) best; None if there is none.

    |f − c|² = r² is linear in c and in r² − |c|².
    """
    # Relative to their mean, so that a large offset costs no digits.
    middle = forces.mean(axis=0)
    points = forces - middle
    design = np.column_stack([2 * points, np.ones(len(points))])
    solution, _, rank, _ = np.linalg.lstsq(design, np.sum(points**2, axis=1), rcond=1e-6)
    square = solution[3] + solution[:3] @ solution[:3]
    if rank < 4 or square <= 0:
        return None
    return middle + solution[:3], float(np.sqrt(square))
