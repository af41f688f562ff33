"""Exhaustive search over pairs of hypotheses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from accelstudy.diagnosis.hypotheses import Hypothesis
from accelstudy.diagnosis.naming import log_evidence, mean_evidence

Array = NDArray[np.float64]

COLLINEAR = 0.05
"""Two spaces are tried together only if the second keeps this share beside the first."""


@dataclass(frozen=True)
class Pair:
    """Two candidates with their best shapes, and the evidence for both at once."""

    names: tuple[str, str]
    best: tuple[Hypothesis, Hypothesis]
    log_evidence: float


def best_pairs(hypotheses: Sequence[Hypothesis], z: Array) -> list[Pair]:
    """Evidence for all pairs of candidates, over all shapes of both; strongest first.

    Parameters
    ----------
    hypotheses : all shapes of all candidates
    z : (r,) array
    """
    r, width = len(z), max(h.dim for h in hypotheses)
    bases = np.zeros((len(hypotheses), r, width))
    for i, h in enumerate(hypotheses):
        bases[i, :, : h.dim] = h.basis
    dims = np.array([h.dim for h in hypotheses])
    names = [h.name for h in hypotheses]
    seen = np.einsum("irk,r->ik", bases, z)
    total = float(z @ z)
    flat = np.moveaxis(bases, 1, 0).reshape(r, -1)
    gram = (flat.T @ flat).reshape(len(dims), width, len(dims), width)

    results: dict[tuple[str, str], list[tuple[float, int, int]]] = {}
    for i in range(len(dims)):
        # Shapes of one effect are alternatives, but two positions may both be bumped.
        others = np.array(
            [
                j
                for j in range(i + 1, len(dims))
                if names[j] != names[i] or is_position(hypotheses[i])
            ]
        )
        if not len(others):
            continue
        cross = gram[i][:, others]
        cross = np.moveaxis(cross, 1, 0)
        left = np.eye(width) - np.einsum("jab,jac->jbc", cross, cross)
        values, vectors = np.linalg.eigh(left)
        # Padding has eigenvalue 1 and no share in the residuals.
        rest = seen[others] - np.einsum("jab,a->jb", cross, seen[i])
        along = np.einsum("jab,ja->jb", vectors, rest) ** 2
        part = seen[i] @ seen[i] + np.sum(along / np.maximum(values, COLLINEAR), axis=1)
        apart = values[:, 0] > COLLINEAR
        for j, value, distinct in zip(others, part, apart, strict=True):
            dim = int(dims[i] + dims[j])
            if distinct and dim < r:
                first, second = sorted((i, int(j)), key=lambda k: -(seen[k] @ seen[k]))
                key = (names[first], names[second])
                log = float(log_evidence(min(value / total, 1.0), dim, r))
                results.setdefault(min(key, key[::-1]), []).append((log, first, second))
    pairs = []
    for found in results.values():
        _, first, second = max(found)
        best = (hypotheses[first], hypotheses[second])
        logs = np.array([log for log, _, _ in found])
        pairs.append(Pair((best[0].name, best[1].name), best, mean_evidence(logs)))
    return sorted(pairs, key=lambda pair: -pair.log_evidence)


def is_position(hypothesis: Hypothesis) -> bool:
    """Whether a hypothesis is about a single position."""
    return hypothesis.effect is None
