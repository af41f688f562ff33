"""The slope of |f| within each hold, as evidence for effects of time.

A long hold shows how the bias changes while nothing moves. Only the part of the slope along gravity
is used. It is the rate of |f|, which does not depend on how the sensor turns; in real holds it does
turn. The deviations from a smooth course over the session show how far the slopes scatter, which is
often more than their standard deviations say.

One row for each hold would add many rows without information. Of a change over the whole session
the means of the holds tell more than the slopes, by the square of the ratio of the session's length
to that of a hold. So only those combinations of slopes become rows of the residual space that add
to what the means tell of an effect of time.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtr, chdtri

from accelstudy.adjustment import Observations
from accelstudy.adjustment.quality import column_basis
from accelstudy.diagnosis.space.residuals import VISIBLE, Residuals, SlopeRows, span
from accelstudy.diagnosis.space.signatures import Signature

Array = NDArray[np.float64]

FREEDOM = 6
"""Least number of slopes beyond those that a smooth course takes up: they show the scatter."""
MOVED = 4.0
"""Standard deviations of a slope beyond which the hold moved and tells nothing of the sensor."""
TENTH = 10
"""One of so many holds may have moved, and one more."""
ALONE = 0.8
"""Share of a slope that a smooth course takes up, beyond which no other slope controls it."""
DOUBT = 1.0
"""Added to the variance 1 of a slope that no other controls: a long hold has slower noise than the
others, but its standard deviation is extrapolated from theirs."""
WORTH = 0.1
"""Least that a combination of slopes adds, as a part of what the means tell of an effect."""
APART = 0.3
"""Least length of what is left of a combination beside the others; a shorter one repeats them."""
SHARE = 0.25
"""Most rows of slopes, as a share of the redundancy of the means. The slopes have a noise level of
their own, which must not decide that of the means."""


@dataclass(frozen=True)
class Slopes:
    """Slopes of |f| within n holds, of unit weight.

    Attributes
    ----------
    values : (n,) array; zero where a hold moved
    by_rate : (n, 3) array, their derivatives by the rates of the output, likewise
    variance : float, of their scatter in units of their own variances, at least 1
    """

    values: Array
    by_rate: Array
    variance: float

    @classmethod
    def of(cls, observed: Observations, forces: Array) -> Slopes | None:
        """Slopes of one session with forces (n, 3); None where they cannot be judged."""
        time = None if observed.hold is None else observed.hold.time
        slope, sd = observed.slope, observed.sd_slope
        if slope is None or sd is None or time is None or np.ptp(time) == 0:
            return None
        along = forces / np.linalg.norm(forces, axis=1, keepdims=True)
        sigma = np.sqrt(np.sum((along * sd) ** 2, axis=1))
        judged = sigma > 0
        by_rate = np.where(judged[:, None], along / np.where(judged, sigma, 1.0)[:, None], 0.0)
        values = np.sum(by_rate * slope, axis=1)
        course = smooth_course(time, by_rate)
        freedom = np.count_nonzero(judged) - course.shape[1]
        if freedom < FREEDOM:
            return None
        for _ in range(1 + len(values) // TENTH):
            taken, squares = about(course, values)
            shown = judged & (taken < ALONE)
            variance = max(1.0, trimmed_mean_square(squares[shown]))
            worst = int(np.argmax(np.where(shown, squares, 0.0)))
            if squares[worst] <= MOVED**2 * variance:
                break
            values[worst], by_rate[worst], course[worst], judged[worst] = 0.0, 0.0, 0.0, False
        weight = 1 / np.sqrt(variance * (1 + DOUBT * taken))
        return cls(values * weight, by_rate * weight[:, None], variance)

    def rows(self, rate: Array) -> Array:
        """What rates of the output (n, 3, k) do to the slopes, (n, k)."""
        return np.asarray(np.einsum("na,nak->nk", self.by_rate, rate))

    def beside(
        self,
        residuals: Residuals,
        parameters: Array,
        modelled: Sequence[Signature],
        others: Iterable[Signature],
    ) -> SlopeRows | None:
        """Slope combinations independent of the means; None if there is none.

        Parameters
        ----------
        residuals : Residuals, of the means
        parameters : (u,) array, of the fit
        modelled : signatures of the effects of the model, in the order of its parameters
        others : signatures of effects that may be missing and change the output within a hold
        """
        design, ends = residuals.design, np.cumsum([0, *(s.rate.shape[2] for s in modelled)])
        by_model = np.zeros((len(self.values), design.shape[1]))
        by_model[:, : ends[-1]] = -np.concatenate([self.rows(s.rate) for s in modelled], axis=1)
        seen = []
        for first, end in pairwise(ends):
            if by_model[:, first:end].any():
                rest = column_basis(np.delete(design, np.s_[first:end], axis=1))
                columns = design[:, first:end]
                means = columns - rest @ (rest.T @ columns)
                seen.append((means, by_model[:, first:end], np.linalg.norm(columns, axis=0)))
        for shown in others:
            rows = residuals.whitened(shown)
            means = residuals.project(rows)
            seen.append((means, self.rows(shown.rate), np.linalg.norm(rows, axis=0)))
        chosen = telling(seen, int(SHARE * residuals.redundancy))
        if not chosen.size:
            return None
        by_model = chosen.T @ by_model
        return SlopeRows(
            rates=np.einsum("nq,na->qna", chosen, self.by_rate),
            design=by_model,
            errors=chosen.T @ self.values + by_model @ parameters,
        )


def smooth_course(time: Array, by_rate: Array) -> Array:
    """Effects of smooth changes of the biases on slopes: constant, linear, and decaying."""
    t = (time - time.min()) / np.ptp(time)
    functions = np.column_stack([np.ones_like(t), t, np.exp(-t / 0.1)])
    return np.asarray(np.einsum("nk,na->nka", functions, by_rate).reshape(len(t), -1))


def about(course: Array, values: Array) -> tuple[Array, Array]:
    """Share of each of values (n,) that a course (n, k) takes up, and squares of what it leaves."""
    basis = np.linalg.qr(course)[0]
    taken = np.sum(basis**2, axis=1)
    left = values - basis @ (basis.T @ values)
    return taken, left**2 / np.maximum(1 - taken, 1 - ALONE)


def trimmed_mean_square(squares: Array) -> float:
    """Variance of normal numbers from their squares (k,); the largest of them are left out."""
    kept = np.sort(squares)[: len(squares) - len(squares) // TENTH - 1]
    limit = chdtri(1, 1 - (len(kept) + 0.5) / (len(squares) + 0.5))
    usual = chdtr(3, limit) / chdtr(1, limit)
    return float(np.mean(kept) / usual)


def telling(seen: Sequence[tuple[Array, Array, Array]], most: int) -> Array:
    """Slope combinations independent of what the means say of effects, (n, q), orthonormal.

    Parameters
    ----------
    seen : sequence of (m, l), (n, l) and (l,) arrays, for each effect what it does to the means
        beside the model, and to the slopes, of unit weight, and its size in the means
    most : int
    """
    combinations = [np.zeros((0, 0))]
    for means, slopes, size in seen:
        directions = span(means, size, VISIBLE)[0]
        shown = np.linalg.norm(means @ directions, axis=0)
        left, ratio, _ = np.linalg.svd(slopes @ directions / shown, full_matrices=False)
        worth = ratio**2 > WORTH
        combinations.append(left[:, worth] * np.minimum(ratio[worth], 1.0))
    if len(combinations) == 1:
        return combinations[0]
    left, length, _ = np.linalg.svd(np.concatenate(combinations[1:], axis=1), full_matrices=False)
    return np.asarray(left[:, length > APART][:, :most])
