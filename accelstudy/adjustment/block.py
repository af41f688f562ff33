"""Results of many replicates that are calibrated together, as far as a study needs them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from accelstudy.adjustment.gauss_helmert import Adjustment

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Block:
    """Calibrations of R replicates of one set-up; NaN where one did not converge.

    Attributes
    ----------
    estimates, sigma_priori : (R, u) arrays, SI; gravity is the last parameter if it is observed
    omega : (R,) array
    redundancy : int
    iterations : (R,) int array
    converged : (R,) bool array
    correlation_sum : (u, u) array, sum over the converged replicates of the correlations from Σ_xx
    """

    estimates: Array
    sigma_priori: Array
    omega: Array
    redundancy: int
    iterations: NDArray[np.int_]
    converged: NDArray[np.bool_]
    correlation_sum: Array

    @classmethod
    def of(cls, result: Adjustment) -> Block:
        """Take from an adjustment what a study needs."""
        q = result.cofactors[result.converged]
        sigma = np.sqrt(np.diagonal(q, axis1=1, axis2=2))
        return cls(
            estimates=result.parameters,
            sigma_priori=result.sigma_priori,
            omega=result.omega,
            redundancy=result.redundancy,
            iterations=result.iterations,
            converged=result.converged,
            correlation_sum=(q / (sigma[:, :, None] * sigma[:, None, :])).sum(axis=0),
        )

    @classmethod
    def joined(cls, parts: Iterable[Block]) -> Block:
        """Join blocks that follow each other."""
        parts = list(parts)
        whole: dict[str, Any] = {
            name: np.concatenate([getattr(part, name) for part in parts])
            for name in ("estimates", "sigma_priori", "omega", "iterations", "converged")
        }
        correlation_sum = np.sum([part.correlation_sum for part in parts], axis=0)
        return replace(parts[0], **whole, correlation_sum=correlation_sum)
