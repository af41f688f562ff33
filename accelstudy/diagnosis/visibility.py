"""What a campaign or a scheme can and cannot show of each effect: limits, detectable sizes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd

from accelstudy.adjustment.quality import noncentrality, solve
from accelstudy.approaches import Approach
from accelstudy.basics.arguments import tidy
from accelstudy.basics.arrays import Array
from accelstudy.basics.shares import sigmas_95
from accelstudy.basics.units import display_unit, to_display
from accelstudy.campaign.calibration.fit import fit_campaign
from accelstudy.campaign.session import Campaign
from accelstudy.diagnosis.file_format import UpperLimit
from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.space.frame import SessionFit
from accelstudy.diagnosis.space.hypotheses import OUTLIER, Hypothesis, cosines
from accelstudy.effects import Effect, get_effect
from accelstudy.schemes import Scheme
from accelstudy.sensors.sensor import SensorModel
from accelstudy.simulation.hold_plan import check_needs_no_plan
from accelstudy.simulation.sessions import Noise, session


class Visibility(NamedTuple):
    """What a campaign or a scheme can show of an effect.

    Attributes
    ----------
    name : str
    status : str, "visible", "invisible" or "untestable"
    reason : str, why it is untestable
    mdb : float, minimal detectable size of a parameter, the worst one, SI; infinite if a
        combination of parameters does not show
    mib : float, size at which the effect can also be told from the nearest other one, likewise
    confused : tuple of (name, cosine), the nearest other effects
    easiest : Effect, in the shape that all this is said of; None if it is not visible
    """

    name: str
    status: str
    reason: str = ""
    mdb: float = np.inf
    mib: float = np.inf
    confused: tuple[tuple[str, float], ...] = ()
    easiest: Effect | None = None


def signature_columns(frame: SessionFit, hypothesis: Hypothesis) -> Array:
    """Signature of each parameter of an effect in the residual space, (m, k)."""
    return frame.residuals.project(frame.rows(hypothesis.effect))


def whole_shapes(shapes: Iterable[Hypothesis]) -> list[Hypothesis]:
    """Shapes of an effect in which all its parameters show."""
    return [h for h in shapes if h.dim == len(h.effect.parameters)]


def upper_limits(frame: SessionFit, known: bool, named: Sequence[str]) -> list[UpperLimit]:
    """95 % limits |p̂| + 1.96 σ of the parameters of all effects that were not found.

    Where the noise is not `known`, σ comes from what the model and the effect together leave of the
    residuals, and Student's t takes the place of 1.96; without any residual left there is no limit.

    Each effect is estimated beside the parameters of the model, in the shape that fits best of
    those in which all its parameters show. The limit is that of the parameter that is known worst.
    An effect without such a shape has no limit.
    """
    limits = []
    for name, shapes in frame.candidates.items():
        if name == OUTLIER or name in named:
            continue
        searched = whole_shapes(shapes.hypotheses)
        if not searched:
            continue
        best = max(searched, key=lambda h: float(np.sum((frame.residuals.z @ h.basis) ** 2)))
        columns = signature_columns(frame, best)
        inverse = np.linalg.pinv(columns)
        residuals = frame.residuals
        values, variance, needed = inverse @ residuals.z, 1.0, sigmas_95()
        if not known:
            left, r = residuals.z - columns @ values, residuals.redundancy - columns.shape[1]
            if r < 1:
                continue
            variance, needed = float(left @ left) / r, sigmas_95(r)
        bounds = np.abs(values) + needed * np.sqrt(variance * np.sum(inverse**2, axis=1))
        worst = int(np.argmax(bounds))
        parameter = best.effect.parameters[worst]
        limit, unit = float(bounds[worst]), parameter.unit
        limits.append(UpperLimit(name=name, parameter=parameter.name, value=limit, unit=unit))
    return limits


def visibilities(frame: SessionFit) -> list[Visibility]:
    """What a campaign can show of each effect that is not in its model.

    The minimal detectable bias (MDB) is the size √(λ0 / dᵀd) of a single parameter at which its
    test at 0.1 % has a power of 80 %. For the minimal identifiable bias (MIB) only the part of d
    counts that the nearest rival cannot imitate.

    Of the shapes of an effect that a diagnosis tries, the one that shows best is judged, and of
    those in which all parameters show if there are any.
    """
    root = np.sqrt(noncentrality(1))
    rows = []
    for name, shapes in frame.candidates.items():
        if name == OUTLIER:
            continue
        judged = whole_shapes(shapes.hypotheses) or shapes.hypotheses
        columns = [signature_columns(frame, h) for h in judged]
        sizes = [np.linalg.norm(c, axis=0) for c in columns]
        mdbs = [_size(root, s) for s in sizes]
        easiest = int(np.argmin(mdbs))
        best = judged[easiest]
        near, left = frame.nearest(best), sizes[easiest]
        for other in [other for other, cosine in near if cosine <= RULES.alike]:
            rivals = frame.candidates[other].hypotheses
            rival = max(rivals, key=lambda h: float(cosines(best.ideal, h.ideal)[0])).basis
            rest = columns[easiest] - rival @ (rival.T @ columns[easiest])
            left = np.minimum(left, np.linalg.norm(rest, axis=0))
        mdb, mib = mdbs[easiest], _size(root, left)
        rows.append(Visibility(name, "visible", "", mdb, mib, near[:3], best.effect))
    rows += [Visibility(name, "invisible") for name in frame.tested.invisible]
    rows += [Visibility(name, "untestable", why) for name, why in frame.tested.untestable.items()]
    return sorted(rows, key=lambda row: row.name)


def _size(root: float, signature_norms: Array) -> float:
    smallest = float(np.min(signature_norms))
    return root / smallest if smallest > 1e-9 * np.max(signature_norms, initial=1e-300) else np.inf


def examine_campaign(
    campaign: Campaign, model: SensorModel, approach: Approach | None = None
) -> SessionFit:
    """Return what a campaign can show beside a model, with its own noise.

    Parameters
    ----------
    campaign : Campaign
    model : SensorModel
    approach : Approach; by default robot-aided if the campaign has the robot's angles
    """
    fit = fit_campaign(campaign, model, approach)
    return SessionFit.of(fit.solution)


def examine_scheme(
    scheme: Scheme, model: SensorModel, approach: Approach, noise: Noise | None = None
) -> SessionFit:
    """Return what a scheme can show beside a model; nothing is known of times and temperatures.

    Raises
    ------
    InputError
        If the positions do not determine the model, or it needs to know more of them.
    """
    check_needs_no_plan(model)
    ideal = session(model, np.zeros(model.n_parameters), scheme.directions)
    observed = ideal.observations(noise or Noise())
    return SessionFit.of(solve(model, approach, observed))


def visibility_table(frame: SessionFit) -> pd.DataFrame:
    """Table for people: one row per effect that is not in the model, in the units shown."""
    rows = []
    for row in visibilities(frame):
        effect, seen = get_effect(row.name), row.status == "visible"
        unit = effect.unit
        near = ", ".join(f"{name} {cosine:.2f}" for name, cosine in row.confused)
        rows.append(
            {
                "effect": row.name,
                "part": effect.part,
                "status": row.status,
                "MDB": tidy(float(to_display(row.mdb, unit)), 3) if seen else np.nan,
                "MIB": tidy(float(to_display(row.mib, unit)), 3) if seen else np.nan,
                "unit": display_unit(unit) if seen else "",
                "with": "" if row.easiest is None else settings_text(row.easiest),
                "confused with": row.reason or near,
            }
        )
    return pd.DataFrame(rows)


def settings_text(effect: Effect) -> str:
    """Settings of an effect as it is written, with their units: ``t=290 s``."""
    units = {one.name: "" if one.unit == "1" else f" {one.unit}" for one in effect.takes}
    return ", ".join(f"{name}={value:.4g}{units[name]}" for name, value in effect.settings.items())
