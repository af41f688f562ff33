"""What follows from a finding: where it lives, what it changed, and what it is worth.

Where it lives: the share of the excess χ² that each group of regressors takes up. A group of k
regressors takes up k of r redundant conditions. Of residuals that have nothing to do with it, it
has a part of Beta(k/2, (r − k)/2) by chance, k/r on average. Of an excess E above the noise, r + E
in all, the group has nearly all if it has k + 0.9 E. Where chance often gives that, as it does
where the redundancy or the excess is small, the share says nothing, and is not told.

What it changed: an effect with the signature S (whitened, by its parameters p) that a model with
the design Ã lacks shifts the estimates of the model by −(ÃᵀÃ)⁻¹ Ãᵀ S p (omitted-variable bias).
With the effect added they shift back: by as much, if first order is enough and the extended model
is right.

What it is worth: the tilt error of a calibrated sensor without and with it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from accelstudy.adjustment.quality import Solution, suspects
from accelstudy.basics.progress import stage
from accelstudy.basics.units import GON
from accelstudy.campaign.calibration.assessment import SUSPECT
from accelstudy.diagnosis.decision.learned import shares_of_places
from accelstudy.diagnosis.decision.posterior import Posterior, of_effects
from accelstudy.diagnosis.decision.problem import Problem, is_exact
from accelstudy.diagnosis.decision.verdict import Finding
from accelstudy.diagnosis.evidence.detection import Chance
from accelstudy.diagnosis.evidence.field import UNKNOWN
from accelstudy.diagnosis.next_positions import NextPosition, next_positions, positions_to_learn
from accelstudy.diagnosis.prediction import relative_variance
from accelstudy.diagnosis.space.examined import ExaminedFit, Frame
from accelstudy.diagnosis.space.groups import LACK_OF_FIT, REPEAT, ROBOT, all_groups
from accelstudy.diagnosis.space.hypotheses import OUTLIER
from accelstudy.diagnosis.space.residuals import Residuals
from accelstudy.diagnosis.visibility import UpperLimit, upper_limits
from accelstudy.effects import HoldConditions
from accelstudy.effects.learned import Learned
from accelstudy.leveling.angles import angles_of, tilt_slope, wrapped
from accelstudy.leveling.error import ATTITUDES, MAX_TILT_GON, cap_forces, holds_in_use

Array = NDArray[np.float64]

SINGLE = "single_position"
"""Group of the one position that is most at odds with the others."""
GROUPS = (
    "direction", ROBOT, REPEAT, "slow_time", "temperature", "previous_position", SINGLE,
)  # fmt: skip
"""Groups of which every campaign is told whether it shows them."""
ABSENT = {
    "direction": "the model has all effects of the direction",
    ROBOT: "gravity alone does not tell the angles of a robot",
    REPEAT: "no attitude was measured twice",
    "previous_position": "the campaign does not give the order of the positions",
    SINGLE: "no position is checked by the others",
}
"""Why nothing is known of groups that need no column of a name."""
NEARLY_ALL = 0.9
"""Share that would seem to say where a pattern lives."""
ROUNDING = 1e-6
"""Excess per redundant condition that rounding errors may leave."""
SELDOM = 0.05
"""Probability with which any pattern may have such a share in one of the groups by chance."""


@dataclass(frozen=True)
class Location:
    """Where the residuals of a fit have more than noise.

    Attributes
    ----------
    shares : dict of group to the share of the excess χ² in its space, in [0, 1], where it tells
    by_chance : dict of these groups to the share that each has of any pattern, on average
    untestable : dict of the other groups to the reason why nothing can be told of them
    """

    shares: dict[str, float]
    by_chance: dict[str, float]
    untestable: dict[str, str]


def locate(problem: Problem, chance: Chance, finding: Finding, variance: float) -> Location:
    """Say where the excess χ² above the noise lives.

    The noise is the given one. Where none is given, it is what remains after what was found or, if
    something unknown is missing, the least that any group of regressors leaves.

    Parameters
    ----------
    problem : Problem
    chance : Chance, residuals without any effect
    finding : Finding
    variance : float, of unit weight, after what was found
    """
    examined, residuals = problem.examined, problem.residuals
    z, r = residuals.z, residuals.redundancy
    if problem.evidence.level.known:
        variance = 1.0
    elif finding.verdict == "unknown":
        spaces = [space for name, space in problem.groups.items() if name != LACK_OF_FIT]
        left = [float((z @ z - space.parts(z)[0]) / (r - space.dims[0])) for space in spaces]
        variance = min([variance, *left])
    groups = {n: space for n, space in all_groups(examined).items() if n != LACK_OF_FIT}
    excess, nearly_all = max(float(z @ z) / variance - r, 0.0), {}
    expected = {name: float(space.dims[0]) for name, space in groups.items()}
    usual = {name: k / r for name, k in expected.items()}
    for name, k in expected.items():
        part = (k + NEARLY_ALL * excess) / (r + excess)
        by_chance = special.betainc((r - k) / 2, k / 2, 1 - part) if 0 < k < r else k >= r
        nearly_all[name] = float(by_chance)
    bumped = examined.candidates.get(OUTLIER)
    if bumped is not None:
        groups[SINGLE] = bumped

        def largest_part(errors: Array) -> Array:
            """Largest part of a single position, and all of them."""
            return np.column_stack([bumped.parts(errors).max(axis=-1), np.sum(errors**2, axis=-1)])

        largest, total = chance.statistic(residuals, largest_part).T
        expected[SINGLE] = float(np.mean(largest))
        usual[SINGLE] = float(np.mean(largest / total))
        enough = (expected[SINGLE] + NEARLY_ALL * excess) / (r + excess)
        nearly_all[SINGLE] = float(np.mean(largest >= enough * total))
    untestable = {}
    for name in dict.fromkeys((*GROUPS, *groups)):
        if name not in groups:
            untestable[name] = _absent(name, problem.frame.hold)
        elif int(groups[name].dims.max()) == 0:
            untestable[name] = "the parameters of the model absorb all of it"
        elif excess < ROUNDING * r:
            untestable[name] = "the residuals have no more than the noise that is assumed"
        elif nearly_all[name] > SELDOM / len(groups):
            untestable[name] = (
                f"with a redundancy of {r} and residuals of this size, nearly all of any pattern "
                "could be in it by chance"
            )
    shares = {}
    for name, space in groups.items():
        if name not in untestable:
            part = float(space.parts(z).max()) / variance
            shares[name] = float(np.clip((part - expected[name]) / excess, 0.0, 1.0))
    return Location(shares, {name: usual[name] for name in shares}, untestable)


def _absent(name: str, hold: HoldConditions) -> str:
    """Say why a campaign does not have a group."""
    columns = {"slow_time": hold.time, "temperature": hold.temperature}
    if name not in columns:
        return ABSENT[name]
    column = name.removeprefix("slow_")
    if columns[name] is None:
        return f"the campaign gives no {column}"
    return f"the {column} is the same in all positions"


@dataclass(frozen=True)
class LikeShape:
    """Where something without a name may live: a target that is a function of a coordinate.

    Attributes
    ----------
    coordinate, target : str
    posterior : float, given that it is such a function, or one of the attitude alone
    """

    coordinate: str
    target: str
    posterior: float


def like_shapes(problem: Problem, posterior: Posterior | None) -> tuple[LikeShape, ...]:
    """Places of what has no name, most probable first, beside the effect that it comes with."""
    told = () if posterior is None else posterior.credible_set
    names = next((one.names for one in told if UNKNOWN in one.names), None)
    shares = {} if names is None else shares_of_places(problem, names)
    like = [LikeShape(*place, p) for place, p in shares.items()]
    return tuple(sorted(like, key=lambda one: -one.posterior))


def limits_of_others(problem: Problem, finding: Finding, known: bool) -> tuple[UpperLimit, ...]:
    """Limits of the effects that were neither found nor left open; the noise may be `known`."""
    names = [choice.best.name for choice in finding.chosen]
    if finding.verdict == "narrowed":
        classes = [alike for one in finding.credible_set for alike in one.classes]
        names += [name for alike in classes for name in alike]
    same = finding.frame is problem.frame
    examined = problem.examined if same else ExaminedFit.of(finding.frame)
    return tuple(upper_limits(examined, known, names))


def separating_positions(frame: Frame, finding: Finding) -> tuple[NextPosition, ...]:
    """Positions that tell the two most probable of the credible set apart, or that show a function.

    Parameters
    ----------
    frame : Frame, of the base fit
    finding : Finding
    """
    if finding.place is not None:
        learned = finding.chosen[0].best.effect
        assert isinstance(learned, Learned)
        with stage("next positions"):
            return tuple(positions_to_learn(finding.frame, learned))
    if finding.posterior is None or finding.verdict not in ("named", "narrowed", "unknown"):
        return ()
    weighed = zip(finding.credible_set, finding.posterior.told, strict=False)
    rivals = [one.best for explanation, one in weighed if of_effects(explanation)]
    if len(rivals) < 2:
        return ()
    with stage("next positions"):
        return tuple(next_positions(frame, *rivals[:2]))


def marked_positions(problem: Problem, trusted: bool) -> tuple[tuple[int, float], ...]:
    """Indices of positions that a calibration with the base model marks, and their p-values.

    Parameters
    ----------
    problem : Problem
    trusted : bool, whether sigma is given, and the base fit does not refute it
    """
    first = problem.base.solution
    if is_exact(first):
        return ()
    marked = suspects(first.model, first.approach, first.observed, SUSPECT, trusted)
    return tuple((int(s.position), s.p_value) for s in marked)


@dataclass(frozen=True)
class Change:
    """Change of a parameter of the base model by the effects that were added, SI.

    Attributes
    ----------
    parameter, unit : str
    before, after : float, estimates without and with the effects
    predicted : float, of after − before
    sigma : float, of after − before
    """

    parameter: str
    unit: str
    before: float
    after: float
    predicted: float
    sigma: float

    @property
    def estimated(self) -> float:
        """After − before."""
        return self.after - self.before


def parameter_changes(problem: Problem, finding: Finding, variance: float) -> tuple[Change, ...]:
    """Compare what added effects should change of the other parameters with what they do.

    Nothing is compared if a position was left out.

    Parameters
    ----------
    problem : Problem
    finding : Finding
    variance : float, of unit weight
    """
    effects = [one.best.shown for one in finding.chosen if one.best.shown is not None]
    if not effects or len(effects) < len(finding.chosen):
        return ()
    base, final, frame = problem.base.solution, finding.frame.solution, problem.frame
    u, residuals = base.model.n_parameters, Residuals.of(base)
    shown = [frame.signature(effect) for effect in effects]
    rows = np.concatenate([residuals.whitened(one) for one in shown], axis=1)
    shift = np.linalg.lstsq(base.design, rows, rcond=None)[0][:u]
    added = slice(u, u + rows.shape[1])
    predicted = shift @ final.parameters[added]
    # By the same theory the noise of the effect's size is all that makes the change uncertain.
    spread = np.einsum("ik,kl,il->i", shift, final.cofactors[added, added], shift)
    sigma = np.sqrt(variance * spread)
    return tuple(
        Change(
            parameter=parameter.name,
            unit=parameter.unit,
            before=float(base.parameters[i]),
            after=float(final.parameters[i]),
            predicted=float(predicted[i]),
            sigma=float(sigma[i]),
        )
        for i, parameter in enumerate(base.model.parameters)
    )


def in_use(hold: HoldConditions, g: float) -> tuple[Array, HoldConditions]:
    """Specific forces (n, 3) of all tilts up to 50 gon, and holds like those of a campaign.

    Parameters
    ----------
    hold : HoldConditions, of the campaign, with the attitudes
    g : float, m/s²
    """
    f_b = cap_forces(MAX_TILT_GON * GON, ATTITUDES, g)
    return f_b, holds_in_use(hold, len(hold.column("roll")), f_b)


def leveling_rms(
    base: Solution, extended: Solution, hold: HoldConditions, variance: float
) -> tuple[float, float] | None:
    """Rms of roll and pitch, rad, that either calibration leaves if the extended model is right.

    None if readings of the extended sensor, which clips, have no tilt.

    It is taken over all tilts up to 50 gon and over the temperatures, times and changes of position
    of the campaign. The noise of the leveled reading is not included, nor are effects of the rig,
    which is absent when the sensor is used.

    Parameters
    ----------
    base, extended : Solution
    hold : HoldConditions, of the campaign
    variance : float, of unit weight of the extended fit
    """
    g = extended.gravity
    f_b, used = in_use(hold, g)
    angles = np.column_stack([used.column("roll"), used.column("pitch")])
    stays = extended.model.stays
    truth = np.where(stays, extended.parameters[: len(stays)], 0.0)
    output = extended.model.sense(f_b, truth, g, used)

    squares = []
    for solution in (base, extended):
        model = solution.model
        kept = model.stays
        p = np.where(kept, solution.parameters[: len(kept)], 0.0)
        corrected = model.correct(output, p, g, used)
        offset = wrapped(angles_of(corrected) - angles)
        slope = tilt_slope(model, p, output, corrected, g, used)[..., kept]
        cofactors = solution.cofactors[: len(p), : len(p)][np.ix_(kept, kept)]
        taken = variance * relative_variance(extended, solution)
        formal = taken * np.einsum("kau,uv,kav->ka", slope, cofactors, slope)
        squares.append(float(np.mean(offset**2 + formal)))
    if not np.all(np.isfinite(squares)):
        return None
    return float(np.sqrt(squares[0])), float(np.sqrt(squares[1]))
