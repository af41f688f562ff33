"""The search for what a fitted model lacks: the evidence for each possibility."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.special import softmax

from accelstudy.adjustment.quality import Solution, solve
from accelstudy.diagnosis.decision import priors
from accelstudy.diagnosis.decision.posterior import Posterior, Weighed
from accelstudy.diagnosis.decision.refits import Refits
from accelstudy.diagnosis.evidence.chance import Chance
from accelstudy.diagnosis.evidence.detection import Detection, detect
from accelstudy.diagnosis.evidence.field import UNKNOWN, Field, shape_weights
from accelstudy.diagnosis.evidence.noise import kinds
from accelstudy.diagnosis.evidence.noise.axes import UnequalAxes
from accelstudy.diagnosis.evidence.noise.colour import colour_density
from accelstudy.diagnosis.evidence.noise.residual_tests import most_evidence, tail_test
from accelstudy.diagnosis.evidence.pairs import all_pairs
from accelstudy.diagnosis.evidence.size import Evidence, Level, log_mean
from accelstudy.diagnosis.evidence.unknown import unknown_beside
from accelstudy.diagnosis.space.examined import ExaminedFit, examine
from accelstudy.diagnosis.space.groups import groups
from accelstudy.diagnosis.space.hypotheses import Hypothesis, Shapes
from accelstudy.diagnosis.space.refinement import refined, strongest
from accelstudy.diagnosis.space.residuals import Residuals
from accelstudy.diagnosis.space.spaces import Spaces

Array = NDArray[np.float64]

RIVAL = 0.5
"""Canonical cosine from which on an effect is listed as a rival."""
ROUNDING = 1e-10
"""Residuals below this share of gravity are rounding errors, and no measurement."""
WORTH = 12.0
"""A candidate whose log evidence is this far below the strongest needs no further shapes."""
UNDECIDED = 2.0
"""Log evidence by which a shape may fall short of the best and still be the true one."""
SAME = 0.25
"""Log evidence within which two effects are equally good."""
FIRST = 5
"""Effects beside which something unknown is looked for."""


@dataclass(frozen=True)
class Search:
    """Search for what the model of a fit lacks; every stage is computed once, when it is needed.

    Parameters
    ----------
    first : Solution, with equal axes
    seed : SeedSequence, of the residuals without any effect
    level : Level, what is known of sigma
    within : (3,) array, variances of the axes within the holds; None if unknown
    """

    first: Solution
    seed: np.random.SeedSequence
    level: Level
    within: Array | None = None

    @cached_property
    def chance(self) -> Chance:
        """Residuals without any effect."""
        return Chance(self.seed, len(self.first.design))

    @property
    def exact(self) -> bool:
        """Whether the campaign is its own model."""
        rms = float(np.sqrt(np.mean(self.first.misclosures**2)))
        return rms < ROUNDING * self.first.gravity

    @cached_property
    def evidence(self) -> Evidence:
        """The evidence of hypotheses in the residual space."""
        return Evidence(self.level, self.residuals.redundancy)

    # --- the fit --------------------------------------------------------------------------------

    @cached_property
    def equal(self) -> ExaminedFit:
        """The fit with equal axes."""
        return examine(self.first)

    @cached_property
    def axes(self) -> UnequalAxes:
        """How probable it is that the axes differ in noise, from the fit with equal ones."""
        residuals = self.equal.frame.residuals
        evidence = Evidence(self.level, residuals.redundancy)
        return UnequalAxes.of(residuals, evidence, self.within)

    @cached_property
    def examined(self) -> ExaminedFit:
        """The base fit and the hypotheses about it.

        The axes are weighted by their noise where unequal axes explain the residuals better than
        equal ones do, with nothing missing or with any single effect.
        """
        if self.exact:
            return self.equal
        residuals = self.equal.frame.residuals
        field = Field.of(self.equal.candidates, {})
        evidence = Evidence(self.level, residuals.redundancy)
        z, best = residuals.z, 0.0
        if field.names:
            nothing = np.logaddexp.reduce(evidence.of_noise(z @ z))
            odds = np.max(field.densities(evidence, z)) - np.log(len(field.names)) - nothing
            best = max(best, float(odds))
        if np.log(priors.AXES) + self.axes.log_evidence <= best:
            return self.equal
        sigma = np.sqrt(self.axes.ratios)
        mean = np.mean(np.sqrt(self.first.variances[:, :3]))
        shaped = np.broadcast_to(mean * sigma / np.mean(sigma), (len(self.first.variances), 3))
        observed = replace(self.first.observed, sigma_force=shaped)
        return examine(solve(self.first.model, self.first.approach, observed))

    @property
    def residuals(self) -> Residuals:
        """Those of the base fit."""
        return self.examined.frame.residuals

    @cached_property
    def groups(self) -> dict[str, Spaces]:
        """Groups of regressors: direction, time and so on."""
        return groups(self.examined)

    @cached_property
    def field(self) -> Field:
        """All candidates, side by side."""
        return Field.of(self.examined.candidates, self.groups)

    @cached_property
    def detection(self) -> Detection:
        """Whether anything is missing."""
        return detect(self.field, self.evidence, self.residuals, self.chance)

    def first_shape(self, name: str) -> Hypothesis:
        """Shape of a candidate that explains most, of those that are tried at first."""
        return strongest(self.examined.candidates[name], self.residuals.z)

    # --- single hypotheses ----------------------------------------------------------------------

    @cached_property
    def shapes(self) -> dict[str, Shapes]:
        """Shapes of each candidate, closer together about the best one where it matters."""
        if not self.field.names:
            return {}
        logs = self.field.densities(self.evidence, self.residuals.z).tolist()
        found = dict(zip(self.field.names, logs, strict=True))
        top = max(logs, default=0.0)
        return {
            name: refined(self.examined, shapes) if found[name] > top - WORTH else shapes
            for name, shapes in self.examined.candidates.items()
        }

    @cached_property
    def logs(self) -> dict[str, Array]:
        """Log density of the residuals under each shape of each candidate."""
        if not self.shapes:
            return {}
        z, shapes = self.residuals.z, self.shapes.values()
        parts = np.concatenate([one.parts(z) for one in shapes])
        dims = np.concatenate([one.dims for one in shapes])
        ends = np.cumsum([len(one) for one in shapes])[:-1]
        each = np.split(self.evidence.of_spaces(parts, dims, z @ z), ends)
        return dict(zip(self.shapes, each, strict=True))

    @cached_property
    def densities(self) -> dict[str, float]:
        """Log density of the residuals under each candidate, over its shapes."""
        return {
            name: float(log_mean(self.logs[name], shape_weights(shapes)))
            for name, shapes in self.shapes.items()
        }

    @cached_property
    def classes(self) -> list[tuple[Hypothesis, tuple[str, ...]]]:
        """Candidates with those that mean the same, strongest evidence first."""
        left = sorted(self.densities, key=lambda name: -self.densities[name])
        classes = []
        while left:
            name = left.pop(0)
            members = self.members(self.best_shape(name))
            alike = [other for other in left if other in members]
            left = [other for other in left if other not in members]
            # Rounding errors must not choose among equally good names: the first one is taken.
            least = self.densities[name] - SAME
            name = min(other for other in (name, *alike) if self.densities[other] >= least)
            classes.append((self.best_shape(name), members))
        return classes

    @cached_property
    def called(self) -> dict[str, str]:
        """Name of its class for each candidate."""
        return {name: best.name for best, members in self.classes for name in members}

    def best_shape(self, name: str) -> Hypothesis:
        """Shape of a candidate that explains most."""
        return strongest(self.shapes[name], self.residuals.z)

    def members(self, hypothesis: Hypothesis) -> tuple[str, ...]:
        """Names that mean the same as a hypothesis in this campaign."""
        if hypothesis.effect is None:
            return (hypothesis.name,)
        if hypothesis.name not in self._members:
            own = self.probable_shapes(hypothesis.name)
            names = self.examined.alike(own)
            self._members[hypothesis.name] = tuple(sorted({*names, hypothesis.name}))
        return self._members[hypothesis.name]

    @cached_property
    def _members(self) -> dict[str, tuple[str, ...]]:
        return {}

    def probable_shapes(self, name: str) -> list[Hypothesis]:
        """Shapes of a candidate between which the residuals do not decide."""
        shapes, logs = self.shapes[name], self.logs[name]
        return [shapes[int(i)] for i in np.flatnonzero(logs > logs.max() - UNDECIDED)]

    def rivals(self, best: Hypothesis, members: Sequence[str]) -> tuple[tuple[str, float], ...]:
        """Other effects with similar signatures, nearest first."""
        if best.effect is None:
            return ()
        return tuple(
            (name, cosine)
            for name, cosine in self.examined.nearest(best)
            if cosine >= RIVAL and name not in members
        )

    def imitators(self, best: Hypothesis, members: Sequence[str]) -> tuple[str, ...]:
        """Other effects that could leave all that one does, and more."""
        if best.effect is None:
            return ()
        return tuple(n for n in self.examined.imitators(best) if n not in members)

    # --- everything -----------------------------------------------------------------------------

    @cached_property
    def singles(self) -> list[Weighed]:
        """One effect, one bumped position, or something unknown."""
        each = -np.log(max(len(self.classes), 1))
        found = [
            Weighed((best.name,), (members,), self.densities[best.name] + each, (best,))
            for best, members in self.classes
        ]
        unknown = self.detection.densities.get(UNKNOWN)
        if unknown is not None:
            found.append(Weighed((UNKNOWN,), ((UNKNOWN,),), unknown + np.log(priors.UNKNOWN)))
        return found

    @cached_property
    def pairs(self) -> list[Weighed]:
        """Two of them, or one of them beside something unknown."""
        k = len(self.classes)
        if k < 2:
            return []
        each = np.log(priors.TWO) - np.log(k * (k + 1) / 2)
        found = []
        for pair in all_pairs(self.shapes, self.residuals, self.evidence):
            one, other = sorted(pair.best, key=lambda h: -self.densities[h.name])
            both = (self.members(one), self.members(other))
            if both[0] != both[1] or one.effect is None:
                names = tuple(self.called.get(h.name, h.name) for h in (one, other))
                found.append(Weighed(names, both, pair.log_density + each, (one, other)))
        for best, members in self.classes[:FIRST]:
            beside = unknown_beside(best, self.groups, self.residuals, self.evidence)
            if beside is not None:
                total = self.densities[best.name] + beside - np.log(k)
                prior = np.log(priors.TWO * priors.UNKNOWN)
                both = (members, (UNKNOWN,))
                found.append(Weighed((best.name, UNKNOWN), both, total + prior))
        return found

    @cached_property
    def noises(self) -> list[Weighed]:
        """Only the noise is wrong, in one of its kinds."""
        residuals, by_level = self.residuals, self.detection.noise
        nothing = float(np.logaddexp.reduce(by_level))
        # Weighted axes need no further evidence that they differ.
        unequal = nothing + np.log(priors.AXES) + self.axes.log_evidence
        if self.examined is not self.equal:
            unequal = float(by_level[0])
        tails = tail_test(residuals.positions, self.chance)
        known = {
            kinds.COLOUR: np.log(priors.COLOUR) + colour_density(residuals, self.evidence),
            kinds.AXES: unequal,
            kinds.TAILS: nothing + np.log(priors.TAILS) + most_evidence(tails.p_value),
        }
        if len(by_level) > 1:
            # More noise than within the holds is an offset from hold to hold.
            name = kinds.LEVEL if self.level.known else kinds.COLOUR
            known[name] = np.logaddexp(known.get(name, -np.inf), by_level[1])
        return [Weighed((name,), ((name,),), float(log)) for name, log in known.items()]

    @property
    def probabilities(self) -> dict[str, float]:
        """Probability of each candidate if just one of them is missing, largest first."""
        logs = self.detection.densities
        ranked = sorted(logs, key=lambda name: -logs[name])
        shares = softmax([logs[name] for name in ranked]).tolist() if ranked else []
        return dict(zip(ranked, shares, strict=True))

    @cached_property
    def posterior(self) -> Posterior:
        """Everything that could be the case, given that something is wrong."""
        return Posterior.of([*self.singles, *self.pairs, *self.noises])

    @cached_property
    def refits(self) -> Refits:
        """Rigorous fits with hypotheses."""
        return Refits(self.examined, self.shapes)
