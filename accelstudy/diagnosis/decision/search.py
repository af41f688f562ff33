"""The search for what a fitted model lacks: screen, name, add, and look again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np
from numpy.typing import NDArray

from accelstudy.adjustment.quality import Solution, solve
from accelstudy.diagnosis.evidence import noise as noises
from accelstudy.diagnosis.evidence.chance import Chance
from accelstudy.diagnosis.evidence.naming import (
    COLOUR,
    UNKNOWN,
    colour_evidence,
    mean_evidence,
    posterior,
    shapes_evidence,
    widths,
)
from accelstudy.diagnosis.evidence.noise import NoiseTest
from accelstudy.diagnosis.evidence.pairs import Pair, best_pairs
from accelstudy.diagnosis.evidence.screening import Screening, screen
from accelstudy.diagnosis.space.hypotheses import (
    OUTLIER,
    EffectShapes,
    Hypothesis,
    Setting,
    Shapes,
    same_space,
    setting_of,
)
from accelstudy.diagnosis.space.location import groups
from accelstudy.diagnosis.space.residuals import Residuals
from accelstudy.diagnosis.space.spaces import Spaces
from accelstudy.errors import InputError
from accelstudy.models import composition_name
from accelstudy.sensor import SensorModel

Array = NDArray[np.float64]

LEVEL_EFFECTS = 0.025
"""Family-wise level of the tests of effects, bumped positions and groups of regressors."""
LEVEL_ADEQUATE = 0.004
"""Family-wise level at which something is still missing beside a named effect."""
SURE = 0.7
"""Posterior probability from which on a name is given."""
PRIOR = {COLOUR: 3.0}
"""Prior weights beside 1 for each class: all real noise has some colour."""
RIVAL = 0.5
"""Canonical cosine from which on an effect is listed as a rival."""
ROUNDING = 1e-10
"""Residuals below this share of gravity are rounding errors, and no measurement."""
AXES_DIFFER = 0.01
"""Level at which axes are weighted by their noise."""
LEAST = 0.05
"""Smallest variance of an axis beside the mean of all: no axis is taken to be without noise."""
WEIGHTINGS = 4
"""The variances of the axes are estimated anew in each weighting, and settle."""


@dataclass(frozen=True)
class Choice:
    """A hypothesis that was chosen.

    Attributes
    ----------
    best : Hypothesis
    members : tuple of str, names that mean the same in this campaign
    probability : float, posterior
    """

    best: Hypothesis
    members: tuple[str, ...]
    probability: float


@dataclass(frozen=True)
class Finding:
    """What a search found.

    Attributes
    ----------
    verdict : str, "named", "gross_error", "noise_model" or "unknown"
    setting : Setting, of the fit with what was chosen, or of the base fit
    reason : str
    chosen : tuple of Choice
    """

    verdict: str
    setting: Setting
    reason: str = ""
    chosen: tuple[Choice, ...] = ()


@dataclass(frozen=True)
class Search:
    """Search for what the model of a fit lacks; every stage is computed once, when it is needed.

    Parameters
    ----------
    first : Solution, with equal axes
    seed : SeedSequence, of the residuals without any effect
    """

    first: Solution
    seed: np.random.SeedSequence

    @property
    def model(self) -> SensorModel:
        """The base model."""
        return self.first.model

    @cached_property
    def chance(self) -> Chance:
        """Residuals without any effect."""
        return Chance(self.seed, len(self.first.design))

    @cached_property
    def axes(self) -> NoiseTest:
        """Whether the axes differ in noise, by the base fit."""
        return noises.axis_test(Residuals.of(self.first), self.chance)

    @property
    def exact(self) -> bool:
        """Whether the campaign is its own model."""
        rms = float(np.sqrt(np.mean(self.first.misclosures**2)))
        return rms < ROUNDING * self.first.gravity

    @cached_property
    def solution(self) -> Solution:
        """The base fit, with the axes weighted by their noise if it clearly differs."""
        return self.weighted(self.first, self.axes)

    def weighted(self, solution: Solution, axes: NoiseTest) -> Solution:
        """Fit again with unequal axes, if they are."""
        if axes.p_value >= AXES_DIFFER or self.exact:
            return solution
        n, mean = len(solution.variances), np.mean(np.sqrt(solution.variances[:, :3]))
        ratios, factors = np.ones(3), np.asarray(axes.estimate)
        for _ in range(WEIGHTINGS):
            ratios = np.maximum(ratios * factors / np.mean(ratios * factors), LEAST)
            sigma = mean * np.sqrt(ratios) / np.mean(np.sqrt(ratios))
            observed = replace(solution.observed, sigma_force=np.broadcast_to(sigma, (n, 3)))
            solution = solve(solution.model, self.first.approach, observed)
            factors = noises.axis_factors(Residuals.of(solution))
        return solution

    @cached_property
    def setting(self) -> Setting:
        """The base fit and the hypotheses about it."""
        return setting_of(self.solution)

    @cached_property
    def residuals(self) -> Residuals:
        """Those of the base fit."""
        return self.setting.frame.residuals

    # --- screening ------------------------------------------------------------------------------

    @cached_property
    def groups(self) -> dict[str, Spaces]:
        """Groups of regressors: direction, time and so on."""
        return groups(self.setting)

    @cached_property
    def screening(self) -> Screening:
        """Tests of all candidates, and of the groups of regressors."""
        return self.screened(self.setting, self.groups)

    def screened(self, setting: Setting, groups: Mapping[str, Spaces]) -> Screening:
        """Test all candidates and groups of regressors of a fit."""
        residuals = setting.frame.residuals
        spaces = {f"group:{name}": space for name, space in groups.items()}
        return screen(
            {**setting.candidates, **spaces},
            residuals.z,
            residuals.redundancy,
            self.chance.errors(residuals),
        )

    # --- naming ---------------------------------------------------------------------------------

    @cached_property
    def evidence_of_effects(self) -> dict[str, float]:
        """Log evidence of all candidates."""
        return {
            name: mean_evidence(shapes_evidence(shapes, self.residuals), widths(shapes))
            for name, shapes in self.shapes.items()
        }

    @cached_property
    def evidence(self) -> dict[str, float]:
        """Log evidence of all single hypotheses."""
        return {
            **self.evidence_of_effects,
            COLOUR: colour_evidence(self.setting.frame.residuals),
            UNKNOWN: self.unknown_evidence,
        }

    @cached_property
    def unknown_evidence(self) -> float:
        """Log evidence of something in one of the groups that is none of the effects."""
        logs = [shapes_evidence(space, self.residuals) for space in self.groups.values()]
        return mean_evidence(np.concatenate(logs)) if logs else 0.0

    @cached_property
    def classes(self) -> list[tuple[Hypothesis, tuple[str, ...]]]:
        """Candidates with those that mean the same, strongest evidence first."""
        left = sorted(self.setting.candidates, key=lambda name: -self.evidence[name])
        classes = []
        while left:
            name = left.pop(0)
            best = self.best_shape(name)
            alike = [
                other
                for other in left
                if other != OUTLIER
                and name != OUTLIER
                and any(same_space(best, h) for h in self.setting.candidates[other])
            ]
            left = [other for other in left if other not in alike]
            classes.append((best, tuple(sorted((name, *alike)))))
        return classes

    def best_shape(self, name: str) -> Hypothesis:
        """Shape of a candidate that explains most."""
        shapes = self.shapes[name]
        return shapes[int(np.argmax(shapes.parts(self.residuals.z)))]

    @cached_property
    def shapes(self) -> dict[str, Shapes]:
        """Shapes of each candidate, close together about the best one of a smooth effect."""
        return {name: self.refined(shapes) for name, shapes in self.setting.candidates.items()}

    def refined(self, shapes: Shapes) -> Shapes:
        """Add shapes between the neighbours of the best one, and again between those."""
        if not isinstance(shapes, EffectShapes) or len(shapes) < 2:
            return shapes
        if shapes[0].smooth is None:
            return self.completed(shapes)
        for _ in range(3):
            best = int(np.argmax(shapes.parts(self.residuals.z)))
            around = (shapes[max(best - 1, 0)].value, shapes[min(best + 1, len(shapes) - 1)].value)
            tried = (self.shaped(shapes[best], v) for v in np.geomspace(*around, 7)[1:-1])
            fine = [*shapes, *(h for h in tried if h is not None)]
            shapes = EffectShapes.of(sorted(fine, key=lambda h: h.value))
        return shapes

    def completed(self, shapes: EffectShapes) -> EffectShapes:
        """Add shapes that were passed over next to the best one, until there are none."""
        hold = self.setting.frame.hold
        while True:
            best = int(np.argmax(shapes.parts(self.residuals.z)))
            effect = shapes[best].effect
            assert effect is not None
            fine = list(shapes)
            for near in (best + 1, best - 1):
                if 0 <= near < len(shapes):
                    other = shapes[near].effect
                    assert other is not None
                    tried = [self.setting.hypothesis(e) for e in effect.between(other, hold)]
                    found = [h for h in tried if h is not None and h.dim == shapes[best].dim]
                    fine[max(best, near) : max(best, near)] = found
            if len(fine) == len(shapes):
                return shapes
            shapes = EffectShapes.of(fine)

    def shaped(self, hypothesis: Hypothesis, value: float) -> Hypothesis | None:
        """Return a smooth effect with another value of its setting; None if it shows less."""
        assert hypothesis.effect is not None
        assert hypothesis.smooth is not None
        effect = type(hypothesis.effect)(**{hypothesis.smooth: float(f"{value:.6g}")})
        shaped = self.setting.hypothesis(effect)
        return shaped if shaped is not None and shaped.dim == hypothesis.dim else None

    @cached_property
    def probabilities(self) -> dict[str, float]:
        """Posterior probabilities given that something is missing; a class under its first name."""
        evidence = {best.name: self.evidence[best.name] for best, _ in self.classes}
        evidence |= {name: self.evidence[name] for name in (COLOUR, UNKNOWN)}
        return posterior(evidence, PRIOR)

    def rivals(self, best: Hypothesis, members: Sequence[str]) -> tuple[tuple[str, float], ...]:
        """Other effects with similar signatures, nearest first."""
        if best.effect is None:
            return ()
        return tuple(
            (name, cosine)
            for name, cosine in self.setting.nearest(best)
            if cosine >= RIVAL and name not in members
        )

    # --- extending the model --------------------------------------------------------------------

    def extended_model(self, chosen: Sequence[Hypothesis]) -> SensorModel:
        """The base model with the effects of hypotheses added."""
        effects = [h.shown for h in chosen if h.shown is not None]
        if not effects:
            return self.model
        together = (*self.model.effects, *effects)
        return SensorModel(composition_name(together), together)

    def refit(self, chosen: Sequence[Hypothesis]) -> Solution | None:
        """Fit rigorously with effects added and bumped positions left out."""
        try:
            model = self.extended_model(chosen)
        except InputError:  # two effects whose parameters have the same names
            return None
        # From an ideal sensor the iterations may not reach a large effect.
        start = dict(zip(self.model.parameter_names, self.first.parameters, strict=False))
        observed = replace(self.first.observed, initial=model.vector(start))
        bumped = [position_of(h) for h in chosen if h.effect is None]
        if bumped:
            observed = observed.take(np.setdiff1d(np.arange(len(self.first.misclosures)), bumped))
        try:
            solution = solve(model, self.first.approach, observed)
        except (InputError, np.linalg.LinAlgError):
            return None
        if not self.first.approach.uses_angles:
            # Readings without a force that belongs to them have no attitude either.
            p = solution.parameters[: model.n_parameters]
            f_b = model.correct(observed.forces[0], p, solution.gravity, observed.hold)
            if np.isnan(f_b).any():
                return None
        return solution if solution.redundancy > 0 else None

    def sharpened(self, chosen: Sequence[Hypothesis]) -> list[Hypothesis]:
        """Search the settings of smooth effects by refits: a large effect is not of first order."""
        sharp = list(chosen)
        for k, start in enumerate(chosen):
            if start.smooth is None:
                continue
            from scipy.optimize import minimize_scalar  # slow to import, and seldom needed

            values = [h.value for h in self.setting.candidates[start.name]]
            low = max((v for v in values if v < start.value), default=start.value)
            high = min((v for v in values if v > start.value), default=start.value)

            def omega(log: float, k: int = k, start: Hypothesis = start) -> float:
                shaped = self.shaped(start, np.exp(log))
                if shaped is None:
                    return self.first.omega
                trial = self.refit([*sharp[:k], shaped, *sharp[k + 1 :]])
                return self.first.omega if trial is None else trial.omega

            found = minimize_scalar(
                omega, bounds=np.log([low, high]), method="bounded", options={"xatol": 1e-4}
            )
            shaped = self.shaped(start, np.exp(found.x))
            if shaped is not None and found.fun < omega(np.log(start.value)):
                sharp[k] = shaped
        return sharp

    def extend(self, chosen: Sequence[Hypothesis]) -> Solution | None:
        """Refit; axes that seemed unequal because of the effect are equal now."""
        solution = self.refit(chosen)
        if solution is None:
            return None
        residuals = Residuals.of(solution)
        try:
            return self.weighted(solution, noises.axis_test(residuals, self.chance))
        except (InputError, np.linalg.LinAlgError):
            return solution

    def extend_best(
        self, chosen: Sequence[tuple[Hypothesis, tuple[str, ...]]]
    ) -> tuple[list[Hypothesis], Solution] | None:
        """Refit with the members of the classes that fit best.

        To first order the members of a class are the same. Large effects are not of first order.
        """
        alternatives = [
            [best if name == best.name else self.best_shape(name) for name in members]
            if best.effect is not None
            else [best]
            for best, members in chosen
        ]
        sharp = [self.sharpened(one) for one in product(*alternatives)]
        refits = [(one, self.extend(one)) for one in sharp]
        solved = [(one, solution) for one, solution in refits if solution is not None]
        return min(solved, key=lambda item: item[1].omega, default=None)

    def adequate(self, solution: Solution) -> tuple[bool, Setting]:
        """Whether nothing more is missing after a refit."""
        setting = setting_of(solution)
        return self.screened(setting, groups(setting)).smallest >= LEVEL_ADEQUATE, setting

    # --- the decision ---------------------------------------------------------------------------

    def find(self) -> Finding:
        """Name what is missing, given that something is."""
        top = next(iter(self.probabilities))
        sure = self.probabilities[top]
        if top == COLOUR and sure >= SURE:
            return self.nothing("successive holds are alike", "noise_model")
        alone = ""
        if top not in (COLOUR, UNKNOWN):
            best, members = next(item for item in self.classes if item[0].name == top)
            refit = self.extend_best([(best, members)])
            if refit is not None:
                (best,), solution = refit
                adequate, setting = self.adequate(solution)
                if adequate and sure >= SURE:
                    verdict = "gross_error" if best.effect is None else "named"
                    return Finding(verdict, setting, chosen=(Choice(best, members, sure),))
                if adequate:
                    second = list(self.probabilities)[1]
                    return self.nothing(
                        f"{top} explains it with a probability of {sure:.2f} only, and {second} "
                        f"with {self.probabilities[second]:.2f}"
                    )
            elif sure >= SURE:
                alone = f"{top} explains most of it, but a model with it has no solution"
        finding = self.find_pair()
        return replace(finding, reason=alone or finding.reason)

    @cached_property
    def pairs(self) -> list[Pair]:
        """All pairs of candidates, strongest evidence first."""
        return best_pairs(self.setting.candidates, self.residuals)

    def find_pair(self) -> Finding:
        """Search all pairs, once no single effect is enough."""
        pairs = self.pairs
        if not pairs:
            return self.nothing("no effect of the catalogue explains it")
        # All pairs together are as probable beforehand as all single effects together.
        prior = dict.fromkeys(map(str, range(len(pairs))), len(self.classes) / len(pairs))
        evidence = {str(i): pair.log_evidence for i, pair in enumerate(pairs)}
        evidence |= {best.name: self.evidence[best.name] for best, _ in self.classes}
        evidence |= {name: self.evidence[name] for name in (COLOUR, UNKNOWN)}
        probabilities = posterior(evidence, PRIOR | prior)
        top = next(iter(probabilities))
        if top == COLOUR and probabilities[top] >= SURE:
            return self.nothing("successive holds are alike", "noise_model")
        if top in (COLOUR, UNKNOWN):
            return self.nothing("no effect or pair of effects explains it")
        if top in self.evidence:
            return self.nothing(f"{top} is most probable, but does not explain all of it")
        pair = pairs[int(top)]
        # Pairs whose members mean the same are one.
        seen = {h.spec: h for other in pairs for h in other.best}
        alike = {spec: self.members(h) for spec, h in seen.items()}
        members = [alike[h.spec] for h in pair.best]
        sure = sum(
            probabilities[str(i)]
            for i, other in enumerate(pairs)
            if {alike[h.spec] for h in other.best} == set(members)
        )
        if sure < SURE:
            return self.nothing(
                f"the most probable pair, {' and '.join(pair.names)}, has a probability of "
                f"{sure:.2f} only"
            )
        refit = self.extend_best(list(zip(pair.best, members, strict=True)))
        if refit is None:
            return self.nothing("the refit with two effects has no solution")
        best, solution = refit
        adequate, setting = self.adequate(solution)
        if not adequate:
            return self.nothing("two effects of the catalogue are not enough")
        chosen = [Choice(h, m, sure) for h, m in zip(best, members, strict=True)]
        chosen.sort(key=lambda choice: choice.best.effect is not None)
        verdict = "gross_error" if chosen[0].best.effect is None else "named"
        return Finding(verdict, setting, chosen=tuple(chosen))

    def nothing(self, reason: str, verdict: str = "unknown") -> Finding:
        """Return that no effect is named, and why."""
        return Finding(verdict, self.setting, reason)

    def members(self, hypothesis: Hypothesis) -> tuple[str, ...]:
        """Names that mean the same as a hypothesis in this campaign."""
        if hypothesis.effect is None:
            return (hypothesis.spec,)
        names = {
            name
            for name, shapes in self.setting.candidates.items()
            if name != OUTLIER and any(same_space(hypothesis, h) for h in shapes)
        }
        return tuple(sorted(names | {hypothesis.name}))

    def chooses(self, names: Sequence[Sequence[str]]) -> bool:
        """Whether effects of these classes have the strongest evidence."""
        wanted = {name for members in names for name in members}
        if len(names) == 1:
            return max(self.evidence_of_effects, key=self.evidence_of_effects.__getitem__) in wanted
        pairs = self.pairs
        return bool(pairs) and set(pairs[0].names) <= wanted


def position_of(hypothesis: Hypothesis) -> int:
    """Index of the position that a hypothesis of a bumped position is about."""
    return int(hypothesis.spec[len(OUTLIER) + 1 : -1])
