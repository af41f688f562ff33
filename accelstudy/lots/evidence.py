"""A sensor of a lot: the evidence of its campaign for everything that its model may lack."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from accelstudy.approaches import Approach
from accelstudy.basics.errors import InputError
from accelstudy.basics.wording import comma_list, words
from accelstudy.campaign.session import Campaign
from accelstudy.diagnosis.decision.problem import BaseFit, fit_base, pose
from accelstudy.diagnosis.evidence.candidates import UNKNOWN
from accelstudy.diagnosis.evidence.noise import AXES, COLOUR, LEVEL, TAILS, tail_test
from accelstudy.diagnosis.evidence.size import Evidence, Level
from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.space.frame import SessionFit
from accelstudy.lots.noise import NoisePrior
from accelstudy.sensors.sensor import SensorModel

NAMELESS = "something without a name "
"""What is unknown, in words."""
MAX_P_VALUE = 0.999
"""Largest p-value of which the evidence is taken, which has a limit there."""
NOISE_PRIORS = {
    LEVEL: RULES.prior_sigma_wrong,
    COLOUR: RULES.prior_coloured,
    AXES: RULES.prior_axes,
    TAILS: RULES.prior_tails,
}
"""Prior weights of kinds of wrong noise, relative to one effect of the catalogue."""


@dataclass(frozen=True)
class SensorEvidence:
    """Evidence of one campaign, as log odds against nothing missing.

    Attributes
    ----------
    campaign : str
    p_value : float, of anything missing in this campaign alone
    odds : dict of name to log odds: an effect, a kind of noise, an outlier position, or "unknown"
        with the coordinate and the target that something without a name has
    classes : tuple of tuple of str, names that mean the same in this campaign
    specs : dict of effect to its best setting
    shapes : dict of lasting effects that show to their shapes
    base : BaseFit, of the campaign; None where it does not determine the model
    """

    campaign: str
    p_value: float = 1.0
    odds: dict[str, float] = field(default_factory=dict)
    classes: tuple[tuple[str, ...], ...] = ()
    specs: dict[str, str] = field(default_factory=dict)
    shapes: dict[str, tuple[str, ...]] = field(default_factory=dict)
    base: BaseFit | None = None

    @cached_property
    def frame(self) -> SessionFit | None:
        """The calibration of the campaign, in which effects are evaluated."""
        return None if self.base is None else SessionFit.of(self.base.solution)


@dataclass(frozen=True, eq=False)
class Sensor:
    """A sensor of a lot, and what its campaign is weighed with.

    Attributes
    ----------
    campaign : Campaign
    model : SensorModel
    approach : Approach
    seed : SeedSequence, of the draws
    noise : NoisePrior, in place of what the campaign says of its noise
    """

    campaign: Campaign
    model: SensorModel
    approach: Approach
    seed: np.random.SeedSequence
    noise: NoisePrior | None = None

    def fit(self) -> BaseFit:
        """Fit the model to the campaign, with the sigma that counts.

        Raises
        ------
        InputError
            If the positions do not determine a model, or leave no redundancy.
        """
        if self.noise is None:
            return fit_base(self.campaign, self.model, self.approach)
        measured = self.campaign.with_sigma(self.noise.sigma)
        return replace(fit_base(measured, self.model, self.approach), level=self.noise.level)

    def evidence(self) -> SensorEvidence:
        """Weigh everything that the model may lack to explain the campaign.

        A campaign that does not determine the model says nothing of what else is missing.
        """
        try:
            problem = pose(self.fit(), self.seed)
        except InputError:
            return SensorEvidence(self.campaign.name)
        by_level, z = problem.noise_density, problem.residuals.z
        logs = dict(problem.singles.densities)
        axes, colour = problem.noise_evidence
        tails = evidence_of(tail_test(problem.residuals, problem.chance).p_value)
        noises = {AXES: axes, COLOUR: colour, TAILS: tails}
        logs |= {name: float(np.logaddexp.reduce(by_level)) + log for name, log in noises.items()}
        known = problem.base.level.known if self.noise is None else self.noise.stated
        if known:  # what is not stated cannot be wrong
            doubted = Level((1.0,), (RULES.freedom_doubted,), known=True)
            evidence = Evidence(doubted, problem.residuals.redundancy)
            logs[LEVEL] = float(evidence.noise_density(z @ z)[0])
        if self.noise is not None:
            by_level = by_level[:1]  # a sensor with a noise of its own is no usual one
        if problem.unknown is not None:
            places = problem.unknown.place_densities(problem.evidence, z)
            logs |= {f"{UNKNOWN}({of} → {t})": float(log) for (of, t), log in places.items()}
        nothing = float(np.logaddexp.reduce(by_level))
        effects = {
            name: [one.effect for one in shapes.hypotheses if one.outlier is None]
            for name, shapes in problem.frame.candidates.items()
        }
        best = problem.singles.best
        return SensorEvidence(
            campaign=self.campaign.name,
            p_value=problem.p_value,
            odds={name: log - nothing for name, log in logs.items()},
            classes=tuple(one.members for one in problem.singles.classes),
            specs={name: best[name].effect.spec for name, shapes in effects.items() if shapes},
            shapes={
                name: tuple(effect.spec for effect in shapes)
                for name, shapes in effects.items()
                if shapes and not shapes[0].sudden
            },
            base=problem.base,
        )


def evidence_of(p_value: float) -> float:
    """Log evidence of a p-value whose density is κ p^(κ − 1), with κ < 1 even, against an even one.

    Unlike the bound of what it can be at most, it has the mean 1 where nothing is wrong, and so has
    the product over the sensors of a lot (Vovk & Wang 2021, Annals of Statistics 49, 1736).
    """
    log = np.log(min(p_value, MAX_P_VALUE))
    return float(np.log(-np.expm1(log) + np.exp(log) * log) - log - 2 * np.log(-log))


def lot_classes(sensors: Sequence[SensorEvidence]) -> dict[str, tuple[str, ...]]:
    """Names that mean the same in most of the campaigns that show them, most evidence first.

    The first one of each class has the most evidence, and stands for the others.
    """
    total: dict[str, float] = {}
    for each in sensors:
        for name, odds in each.odds.items():
            total[name] = total.get(name, 0.0) + odds
    left, classes = sorted(total, key=lambda name: (-round(total[name], 6), name)), {}
    while left:
        name, *left = left
        same = [other for other in left if _same(sensors, name, other)]
        left = [other for other in left if other not in same]
        classes[name] = (name, *same)
    return classes


def _same(sensors: Iterable[SensorEvidence], one: str, other: str) -> bool:
    """Whether most of the campaigns that show two names cannot tell them apart."""
    shown = [each for each in sensors if one in each.odds and other in each.odds]
    alike = sum(any({one, other} <= {*members} for members in e.classes) for e in shown)
    return 2 * alike > len(shown)


def either(names: Sequence[str]) -> str:
    """Names that mean the same, or something without a name, in words."""
    return comma_list([words(name).replace(UNKNOWN, NAMELESS, 1) for name in names], "or")
