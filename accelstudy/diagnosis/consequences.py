"""What follows from a finding: where it lives, what it changed, and what it is worth.

Where it lives: the posterior over coordinates and targets, if what is missing is a smooth function
of one coordinate of the session, whether it has a name or not.

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

from accelstudy.adjustment.quality import Solution, suspects
from accelstudy.basics.progress import stage
from accelstudy.basics.units import GON
from accelstudy.campaign.calibration.assessment import SUSPECT
from accelstudy.diagnosis.decision.learned import shares_of_places
from accelstudy.diagnosis.decision.posterior import of_effects
from accelstudy.diagnosis.decision.problem import Problem, is_exact
from accelstudy.diagnosis.decision.verdict import Finding
from accelstudy.diagnosis.evidence.field import UNKNOWN
from accelstudy.diagnosis.next_positions import NextPosition, next_positions, positions_to_learn
from accelstudy.diagnosis.prediction import relative_variance
from accelstudy.diagnosis.space.examined import ExaminedFit, Frame
from accelstudy.diagnosis.space.residuals import Residuals
from accelstudy.diagnosis.visibility import UpperLimit, upper_limits
from accelstudy.effects import HoldConditions
from accelstudy.effects.learned import Learned
from accelstudy.leveling.angles import angles_of, tilt_slope, wrapped
from accelstudy.leveling.error import ATTITUDES, MAX_TILT_GON, cap_forces, holds_in_use

Array = NDArray[np.float64]

MISSING = ("named", "narrowed", "learned", "unknown")
"""Verdicts by which the model lacks something."""


@dataclass(frozen=True)
class LikeShape:
    """Where what is missing may live: a target that is a function of a coordinate.

    Attributes
    ----------
    coordinate, target : str
    posterior : float, given that it is such a function, or one of the attitude alone
    """

    coordinate: str
    target: str
    posterior: float


def like_shapes(problem: Problem, finding: Finding) -> tuple[LikeShape, ...]:
    """Places of what is missing, most probable first; none if nothing is.

    They are those of all that is missing or, where the most probable explanation with something
    unknown has effects with names, of what is beside these.
    """
    if finding.verdict not in MISSING:
        return ()
    told = finding.credible_set if finding.verdict in ("unknown", "learned") else ()
    names = next((one.names for one in told if UNKNOWN in one.names), (UNKNOWN,))
    like = [LikeShape(*place, p) for place, p in shares_of_places(problem, names).items()]
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
