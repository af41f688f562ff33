"""The evidence for two or three candidates together, each weighed beside the others.

A set of shapes spans one space, and has the density of any space (`evidence.size`). With a set R,
whose basis beside the model is orthonormal, and a further shape s with the basis Q, the space of
both explains

    ‖P_R z‖² + bᵀ (I − CᵀC)⁻¹ b,   C = Rᵀ Q,   b = Qᵀ z − Cᵀ Rᵀ z,

exactly, without any iteration. The evidence of a set and one more candidate k, over its shapes s
with their prior probabilities w, is that of the set times

    Σ_s w_s m(z | R ∪ s) / m(z | R),

where the members of the set have the shapes that explain most. Sets are found from the most
probable one outwards: it is extended by each candidate, or one of its members is exchanged.
Subtracting the mean of the other effects, as in a sum of single effects (Wang et al. 2020, J. R.
Stat. Soc. B 82, 1273), costs far less and finds less where signatures are correlated.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import TypeAlias

import numpy as np
from scipy.special import gammaln

from accelstudy.basics.arrays import Array
from accelstudy.diagnosis.evidence.bounds import within_bounds
from accelstudy.diagnosis.evidence.candidates import Field
from accelstudy.diagnosis.evidence.size import Evidence
from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.space.hypotheses import OUTLIER, Hypotheses, Hypothesis, joint_basis
from accelstudy.diagnosis.space.residuals import Residuals

Numbers = tuple[int, ...]
"""Numbers of candidates, ascending; that of the outlying positions may be there twice."""


EffectSet: TypeAlias = tuple[tuple[Hypothesis, ...], float]
"""Candidates in their best shapes, and the log density of the residuals with all of them."""


@cache
def set_prior(size: int, count: int) -> float:
    """Log of the prior weight of each set of `size` of `count` classes of candidates.

    All sets of one weigh 1 together, and each further member costs the same.
    """
    sets = gammaln(count + size) - gammaln(size + 1) - gammaln(count)
    return float((size - 1) * np.log(RULES.prior_two) - sets)


def weigh_sets(
    candidates: Mapping[str, Hypotheses], residuals: Residuals, evidence: Evidence
) -> list[EffectSet]:
    """Evidence for the sets of two and more candidates that explain residuals best.

    Parameters
    ----------
    candidates : mapping of name to shapes
    residuals : Residuals
    evidence : Evidence
    """
    if not candidates:
        return []
    search = _Search(candidates, residuals, evidence)
    search.extend(())
    singles = sorted(search.weights, key=search.weights.__getitem__, reverse=True)
    for one in singles[: RULES.sets_started]:
        search.extend(one)
    while len(search.extended) < RULES.sets_extended and (further := search.next()) is not None:
        search.extend(further)
    return search.sets()


class _Search:
    """Sets of candidates, the strongest of which are extended by one more.

    Attributes
    ----------
    found : dict of set to its log density, and its best shapes
    weights : dict of set to its log density times its prior weight
    extended : sets that were extended
    """

    def __init__(
        self, candidates: Mapping[str, Hypotheses], residuals: Residuals, evidence: Evidence
    ) -> None:
        self.z, self.evidence = residuals.z, evidence
        self.square = float(self.z @ self.z)
        field, count = Field(candidates), len(candidates)
        self.shapes, spaces = field.shapes, field.spaces
        self.factors = np.array([within_bounds(one, self.z, evidence) for one in self.shapes])
        self.shape_priors = np.log(spaces.prior * count) + self.factors
        self.firsts, self.counts = field.starts[:-1], np.diff(field.starts)
        self.owners = np.repeat(np.arange(count), self.counts)
        self.outliers = list(candidates).index(OUTLIER) if OUTLIER in candidates else -1
        self.dims, self.starts = spaces.dims, spaces.ends[:-1]
        # Shapes of one dimension are projected together.
        self.alike = [
            (some := np.flatnonzero(self.dims == dim), self.starts[some][:, None] + np.arange(dim))
            for dim in np.unique(self.dims)
        ]
        self.gram, self.seen = spaces.vectors.T @ spaces.vectors, self.z @ spaces.vectors
        nothing = float(np.logaddexp.reduce(evidence.noise_density(self.square)))
        self.found: dict[Numbers, tuple[float, tuple[int, ...]]] = {(): (nothing, ())}
        self.weights: dict[Numbers, float] = {}
        self.extended: set[Numbers] = set()

    def extend(self, numbers: Numbers) -> None:
        """Weigh a set with each candidate, whose shapes are integrated."""
        self.extended.add(numbers)
        total, chosen = self.found[numbers]
        alone, logs = self._with_each_further(chosen)
        logs += self.shape_priors
        sums = np.logaddexp.reduceat(logs, self.firsts) + (total - alone)
        for k in np.flatnonzero(np.isfinite(sums)).tolist():
            more, log = tuple(sorted((*numbers, k))), float(sums[k])
            if more not in self.found or self.found[more][0] < log:
                first = int(self.firsts[k])
                best = first + int(np.argmax(logs[first : first + self.counts[k]]))
                self.found[more] = log, (*chosen, best)
                self.weights[more] = log + set_prior(len(more), len(self.counts))

    def next(self) -> Numbers | None:
        """Strongest set that was not extended yet, or such a set without one of its members."""
        least = max(self.weights.values(), default=0.0) - RULES.sets_within
        strong = [numbers for numbers, weight in self.weights.items() if weight > least]
        for numbers in sorted(strong, key=self.weights.__getitem__, reverse=True):
            without = [(*numbers[:i], *numbers[i + 1 :]) for i in range(len(numbers))]
            for one in (numbers, *without):
                if len(one) < RULES.set_members and one in self.found and one not in self.extended:
                    return one
        return None

    def sets(self) -> list[EffectSet]:
        """Sets of two and more; in the strongest, bounds hold for each beside the others."""
        least = max(self.weights.values(), default=0.0) - RULES.bounds_within
        sets = []
        for numbers, (log, chosen) in self.found.items():
            if len(chosen) < 2:
                continue
            best = tuple(self.shapes[i] for i in chosen)
            for one, i in zip(best, chosen, strict=True):
                if self.weights[numbers] > least and one.estimates is not None:
                    beside = joint_basis([o for o in best if o is not one], len(self.z))
                    log += within_bounds(one, self.z, self.evidence, beside) - self.factors[i]
            sets.append((best, float(log)))
        return sets

    def _with_each_further(self, chosen: tuple[int, ...]) -> tuple[float, Array]:
        """Log density of the residuals with some shapes, and with each further one as well, (s,).

        It is −∞ for a shape of which too little is left beside these, and for other shapes of the
        same effect, which are alternatives. Two positions may both be outliers.
        """
        spans = [np.arange(self.starts[i], self.starts[i] + self.dims[i]) for i in chosen]
        columns = np.concatenate([np.zeros(0, dtype=int), *spans])
        root = np.linalg.inv(np.linalg.cholesky(self.gram[np.ix_(columns, columns)]))
        taken, cross = root @ self.seen[columns], root @ self.gram[columns]
        part, rest = float(taken @ taken), self.seen - taken @ cross
        possible = len(columns) + self.dims < self.evidence.redundancy
        for i in chosen:
            if self.owners[i] != self.outliers:
                possible[self.owners == self.owners[i]] = False
        parts = np.full(len(self.dims), part)
        for some, of in self.alike:
            shared = cross[:, of].transpose(1, 0, 2)
            left = np.eye(of.shape[1]) - np.swapaxes(shared, 1, 2) @ shared
            values, vectors = np.linalg.eigh(left)
            along = np.einsum("sij,si->sj", vectors, rest[of]) ** 2
            parts[some] += np.sum(along / np.maximum(values, RULES.collinear), axis=1)
            possible[some] &= values[:, 0] > RULES.collinear
        count = len(columns)
        # That of the set alone is the last one; of an empty set it is known.
        parts, dims = np.append(parts, part), np.append(count + self.dims, max(count, 1))
        logs = self.evidence.spaces_density(parts, dims, self.square)
        alone = float(logs[-1]) if chosen else self.found[()][0]
        return alone, np.where(possible, logs[:-1], -np.inf)
