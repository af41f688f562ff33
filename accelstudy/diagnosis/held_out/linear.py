"""Held-out positions to first order, for many residuals at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from accelstudy.diagnosis.space.frame import Frame
from accelstudy.diagnosis.space.hypotheses import Hypothesis

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LinearSplit:
    """Positions of one fit, in two parts.

    Attributes
    ----------
    frame : Frame, of all positions
    fitted, held : (f,) and (h,) int arrays
    """

    frame: Frame
    fitted: NDArray[np.int_]
    held: NDArray[np.int_]

    @cached_property
    def rows(self) -> tuple[NDArray[np.int_], NDArray[np.int_]]:
        """Rows of the conditions of either part; observed gravity is with the fitted one."""
        n, c = self.frame.residuals.whitening.shape[:2]
        fitted, held = (
            (part[:, None] * c + np.arange(c)).ravel() for part in (self.fitted, self.held)
        )
        last = np.arange(n * c, len(self.frame.residuals.positions.design))
        return np.concatenate([fitted, last]), held

    @cached_property
    def designs(self) -> tuple[Array, Array]:
        """Ã of either part."""
        design = self.frame.residuals.positions.design
        return design[self.rows[0]], design[self.rows[1]]

    @cached_property
    def cofactors(self) -> Array:
        """Of the parameters by the fitted part, (u, u)."""
        a = self.designs[0]
        return np.asarray(np.linalg.inv(a.T @ a), dtype=float)

    def beside(self, errors: Array) -> tuple[Array, Array]:
        """What the base model leaves of the fitted part, and of the held-out part it predicts.

        Parameters
        ----------
        errors : (b, m) array, of all positions
        """
        a, b = self.designs
        estimates = errors[:, self.rows[0]] @ a @ self.cofactors
        return (
            errors[:, self.rows[0]] - estimates @ a.T,
            errors[:, self.rows[1]] - estimates @ b.T,
        )

    def corrections(self, hypothesis: Hypothesis, left: Array) -> Array:
        """Corrections of the prediction by an effect that is fitted, too, (b, h c).

        Parameters
        ----------
        hypothesis : Hypothesis, about an effect
        left : (b, f c) array, what the base model leaves of the fitted part
        """
        ((fit, rest),) = self.predictors([hypothesis])
        return np.asarray(left @ fit @ rest)

    def predictors(self, hypotheses: Sequence[Hypothesis]) -> list[tuple[Array, Array]]:
        """Matrices (f c, l) and (l, h c), whose product makes such corrections.

        Parameters
        ----------
        hypotheses : shapes of one effect
        """
        effects = [one.effect for one in hypotheses if one.effect is not None]
        shown = self.frame.residuals.positions.whitened(self.frame.signatures(effects))
        found = []
        columns = np.split(shown, len(effects), axis=1)
        for one, own in zip(hypotheses, columns, strict=True):
            fitted, rest = self.beside((own @ one.directions).T)
            found.append((np.asarray(np.linalg.pinv(fitted), dtype=float), rest))
        return found
