"""Formulas for what a learned function may be: as a person would write them, ranked by evidence.

A form, such as a parabola or a sine with a free period, is a few functions of the coordinate. With
each of its settings, and for each component of the target by itself, it is a space of residuals,
and is weighed as all hypotheses of the diagnosis are (`accelstudy.diagnosis.evidence.size`). Beside
the forms stands any other smooth function, as probable at first as what no catalogue has.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp, softmax
from scipy.stats import f as f_distribution

from accelstudy.basics.units import shown_unit
from accelstudy.basics.wording import comma_list, estimate
from accelstudy.diagnosis.decision.learned import coordinate_values, weighted_shapes
from accelstudy.diagnosis.decision.priors import UNKNOWN
from accelstudy.diagnosis.evidence.size import Evidence
from accelstudy.diagnosis.forms import TARGETS, Form, coordinate_of, forms
from accelstudy.diagnosis.space.examined import Frame
from accelstudy.diagnosis.space.residuals import VISIBLE
from accelstudy.diagnosis.space.shapes import (
    SURVIVES,
    Place,
    function_rows,
    less_its_mean,
)
from accelstudy.effects.learned import ANGLES, OF_EACH, WAVES, Learned

Array = NDArray[np.float64]

OTHER = "as another smooth function"
TAKES_PART = 0.01
"""Level of the test whether a component takes part."""
WORTH = 0.01
"""Posterior from which on a formula is worth a line."""
AT_ONCE = 20
"""Settings that are weighed together."""


@dataclass(frozen=True)
class Formula:
    """A formula for a learned function.

    Attributes
    ----------
    text : str, in plain words, such as "once per turn, 8.0 mm/s²"
    posterior : float, given that something is missing that is a function of this coordinate
    """

    text: str
    posterior: float


@dataclass(frozen=True)
class Ranking:
    """What a learned function may be.

    Attributes
    ----------
    axes : tuple of str, components of the target that take part
    subject : str, what depends on what: "the bias of x and y depends on the yaw"
    formulas : tuple of Formula, most probable first; one of them is any other smooth function
    """

    axes: tuple[str, ...]
    subject: str
    formulas: tuple[Formula, ...]


def ranked(
    frame: Frame, evidence: Evidence, effect: Learned, place: Place, beside: Array
) -> Ranking:
    """Rank the formulas for a learned function.

    Parameters
    ----------
    frame : Frame, of the fit without the function
    evidence : Evidence
    effect : Learned, which says of what the function is one
    place : Place, coordinate and target of the same
    beside : (m, l) array, basis of the space of what was found beside it
    """
    evidence = replace(evidence, redundancy=evidence.redundancy - beside.shape[1])
    functions = _Functions(frame, effect, beside)
    found = [
        (form, setting, log)
        for form in forms(effect.coordinate, functions.arguments)
        for setting, log in [functions.weigh(form, evidence)]
        if np.isfinite(log)
    ]
    other = _of_smooth(functions, place, evidence)
    each = np.log((1 - UNKNOWN) / max(len(found), 1))
    logs = [log + each for _, _, log in found] + [other + np.log(UNKNOWN)]
    posterior = softmax(logs).tolist()

    components, unit = TARGETS[effect.target].components, TARGETS[effect.target].unit
    taking = tuple(range(len(components)))
    if found:
        best, setting, _ = found[int(np.argmax(posterior[:-1]))]
        taking = functions.fit(best, setting, taking).taking
    worth = [(*one[:2], p) for one, p in zip(found, posterior, strict=False) if p >= WORTH]
    formulas = [
        Formula(functions.fit(form, setting, taking).said(unit, components), p)
        for form, setting, p in worth
    ]
    formulas.append(Formula(OTHER, posterior[-1]))
    names = [components[i] for i in taking]
    which = "all axes" if len(names) == len("xyz") else comma_list(names)
    subject = TARGETS[effect.target].words.format(which)
    return Ranking(
        axes=tuple(names),
        subject=f"{subject} depends on {coordinate_of(effect.coordinate).words}",
        formulas=tuple(sorted(formulas, key=lambda one: -one.posterior)),
    )


def _of_smooth(functions: _Functions, place: Place, evidence: Evidence) -> float:
    """Log density of the residuals under any smooth function, even over its smoothness."""
    z, effect = functions.z, functions.effect
    coordinate = WAVES.get(effect.coordinate, effect.coordinate)
    shapes = [
        one
        for one in weighted_shapes(place, functions.frame, functions.beside, z[None], evidence)
        if (one.effect.coordinate, one.effect.target) == (coordinate, effect.target)
    ]
    if not shapes:
        return float(logsumexp(evidence.of_noise(np.array([z @ z]))))
    along, shares = [(z @ one.vectors)[None] ** 2 for one in shapes], [s.shares for s in shapes]
    logs = evidence.of_shapes(along, shares, np.array([z @ z]))
    return float(logsumexp(logs) - np.log(len(shapes)))


def argument(frame: Frame, effect: Learned) -> Array:
    """Return the coordinate of a learned effect in the positions, (n, a)."""
    name = WAVES.get(effect.coordinate, effect.coordinate)
    if name in (*ANGLES, *OF_EACH, "temperature rate"):
        values = coordinate_values(effect, frame)
        return values if name in (*OF_EACH, "angle") else values[:, :1]
    return frame.hold.column(name)[:, None]


@dataclass(frozen=True)
class _Fit:
    """A form with a setting, fitted to residuals.

    Attributes
    ----------
    form : Form
    setting : float
    components : tuple of int, that were fitted
    sizes, sigmas : (c,) arrays, amplitude of a sine, or how far another form goes; and its sigma
    taking : tuple of int, components that take part; the most significant one if none is
    """

    form: Form
    setting: float
    components: tuple[int, ...]
    sizes: Array
    sigmas: Array
    taking: tuple[int, ...]

    def said(self, unit: str, names: tuple[str, ...]) -> str:
        """Say the form with its setting and its size in each component."""
        sizes = [estimate(float(size), self.sigmas.max(), unit)[0] for size in self.sizes]
        if len({*sizes}) > 1:
            sizes = [f"{s} ({names[i]})" for s, i in zip(sizes, self.components, strict=True)]
        shown, by = comma_list(list(dict.fromkeys(sizes))), "" if self.form.is_sine else "by "
        return f"{self.form.said(self.setting)}, {by}{shown} {shown_unit(unit)}"


class _Functions:
    """Functions of the coordinate of an effect, in the residuals of a fit without it."""

    def __init__(self, frame: Frame, effect: Learned, beside: Array) -> None:
        self.frame, self.effect, self.beside = frame, effect, beside
        self.z = frame.residuals.z - beside @ (beside.T @ frame.residuals.z)
        self.arguments = argument(frame, effect)
        self.freedom = frame.residuals.redundancy - beside.shape[1]

    def _left(self, form: Form, settings: Array) -> tuple[Array, Array]:
        """What the model leaves of a form with t settings, (t, m, c, k), and its share, (t,)."""
        phi = [form.basis(s, self.arguments) for s in settings]
        rows = function_rows(
            self.frame, self.effect.target, less_its_mean(np.concatenate(phi, axis=-1))
        )
        left = self.frame.residuals.project(rows)
        left -= self.beside @ (self.beside.T @ left)
        shape = len(rows), -1, len(settings), phi[0].shape[-1]
        rows, left = (np.moveaxis(one.reshape(shape), 2, 0) for one in (rows, left))
        whole, seen = (np.sum(one**2, axis=(1, 2, 3)) for one in (rows, left))
        return left, seen / np.where(whole > 0, whole, np.inf)

    def weigh(self, form: Form, evidence: Evidence) -> tuple[float, float]:
        """Best setting of a form, and its log density over all settings."""
        logs = [
            self._densities(form, settings, evidence)
            for settings in np.array_split(form.settings, -(-len(form.settings) // AT_ONCE))
        ]
        each = np.concatenate(logs)
        return float(form.settings[np.argmax(each)]), float(logsumexp(each) - np.log(len(each)))

    def _densities(self, form: Form, settings: Array, evidence: Evidence) -> Array:
        """Log density of the residuals with each setting (t,) of a form; −inf if none shows."""
        left, share = self._left(form, settings)
        columns = left.reshape(*left.shape[:2], -1)
        size = np.linalg.norm(columns, axis=1, keepdims=True).max(axis=2, keepdims=True)
        u, values, _ = np.linalg.svd(columns / np.where(size > 0, size, 1.0), full_matrices=False)
        kept = values > VISIBLE
        parts = np.sum(np.where(kept, (self.z @ u) ** 2, 0.0), axis=1)
        dims = np.where(share > SURVIVES, np.count_nonzero(kept, axis=1), 0)
        logs = evidence.of_spaces(parts, np.maximum(dims, 1), float(self.z @ self.z))
        return np.where(dims > 0, logs, -np.inf)

    def fit(self, form: Form, setting: float, components: tuple[int, ...]) -> _Fit:
        """Fit a form to some components."""
        left = self._left(form, np.array([setting]))[0][0][:, list(components)]
        m, count, k = left.shape
        inverse = np.linalg.pinv(left.reshape(m, -1), rcond=VISIBLE)
        values = inverse @ self.z
        rest = self.z - left.reshape(m, -1) @ values
        freedom = max(self.freedom - len(values), 1)
        cofactors = (inverse @ inverse.T).reshape(count, k, count, k) * (rest @ rest) / freedom
        each = values.reshape(count, k)
        own = [(a, cofactors[i, :, i]) for i, a in enumerate(each)]
        slopes = [self._slope(form, setting, a, i) for a, i in zip(each, components, strict=True)]
        square = np.array([a @ np.linalg.pinv(c) @ a / k for a, c in own])
        limit = f_distribution.isf(TAKES_PART, k, freedom)
        taking = square >= min(limit, square.max())
        return _Fit(
            form,
            setting,
            components,
            np.array([d @ a for d, a in zip(slopes, each, strict=True)]),
            np.sqrt([d @ c @ d for d, (_, c) in zip(slopes, own, strict=True)]),
            tuple(i for i, takes in zip(components, taking, strict=True) if takes),
        )

    def _slope(self, form: Form, setting: float, a: Array, component: int) -> Array:
        """Derivatives by the coefficients a (k,) of an amplitude, or of how far a form goes."""
        if form.is_sine:
            return a / np.linalg.norm(a)
        phi = form.basis(setting, self.arguments[:, min(component, self.arguments.shape[1] - 1)])
        h = phi @ a
        return np.asarray(phi[np.argmax(h)] - phi[np.argmin(h)])
