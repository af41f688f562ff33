"""Formulas for what a learned function may be: as a person would write them, ranked by evidence.

A form, such as a parabola or a sine with a free period, is a few functions of the coordinate. With
each of its settings, and for each component of the target by itself, it is a space of residuals,
and is weighed as all hypotheses of the diagnosis are (`accelstudy.diagnosis.evidence.size`). Beside
the forms stands any other smooth function, as probable at first as what no catalogue has.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp, softmax
from scipy.stats import f as f_distribution

from accelstudy.basics.units import shown_unit
from accelstudy.basics.wording import comma_list, estimate
from accelstudy.diagnosis.coordinates import ANGLES, TARGETS, Coordinate, coordinate_of
from accelstudy.diagnosis.decision.learned import coordinate_values, weigh_place
from accelstudy.diagnosis.evidence.size import Evidence, log_mean
from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.space.frame import SessionFit
from accelstudy.diagnosis.space.residuals import Residuals, spans
from accelstudy.diagnosis.space.shapes import Place, function_rows, less_its_mean
from accelstudy.effects.learned import OF_EACH, WAVES, Learned

Array = NDArray[np.float64]

OTHER_FORM = "as another smooth function"
MIN_POSTERIOR = 0.01
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


def rank_formulas(
    frame: SessionFit, evidence: Evidence, effect: Learned, place: Place, beside: Array
) -> Ranking:
    """Rank the formulas for a learned function.

    Parameters
    ----------
    frame : SessionFit, of the fit without the function
    evidence : Evidence
    effect : Learned, which says of what the function is one
    place : Place, coordinate and target of the same
    beside : (m, l) array, basis of the space of what was found beside it
    """
    functions = _Functions(
        frame, frame.residuals.orthogonal_to(beside), effect, argument(frame, effect)
    )
    evidence = replace(evidence, redundancy=functions.residuals.redundancy)
    found = []
    for form in forms(effect.coordinate, functions.arguments):
        logs = functions.densities(form, evidence)
        if np.isfinite(logs).any():
            found.append((form, float(form.settings[np.argmax(logs)]), float(log_mean(logs))))
    each = np.log((1 - RULES.prior_unknown) / max(len(found), 1))
    other = functions.density_of_others(place, evidence) + np.log(RULES.prior_unknown)
    posterior = softmax([*(log + each for _, _, log in found), other]).tolist()

    target = TARGETS[effect.target]
    taking = tuple(range(len(target.components)))
    if found:
        best, setting, _ = found[int(np.argmax(posterior[:-1]))]
        *_, taking = functions.fit(best, setting, taking)
    formulas = [Formula(OTHER_FORM, posterior[-1])]
    for (form, setting, _), p in zip(found, posterior, strict=False):
        if p >= MIN_POSTERIOR:
            sizes, sigmas, _ = functions.fit(form, setting, taking)
            shown = _size_text(sizes, sigmas, target.unit, [target.components[i] for i in taking])
            by = "" if form.is_sine else "by "
            formulas.append(Formula(f"{form.text(setting)}, {by}{shown}", p))
    names = tuple(target.components[i] for i in taking)
    which = "all axes" if len(names) == len("xyz") else comma_list(names)
    subject = f"{target.words.format(which)} depends on {coordinate_of(effect.coordinate).words}"
    return Ranking(names, subject, tuple(sorted(formulas, key=lambda one: -one.posterior)))


def _size_text(sizes: Array, sigmas: Array, unit: str, names: Sequence[str]) -> str:
    """Say the size of a form in each component, once if they are alike."""
    texts = [estimate(float(size), sigmas.max(), unit)[0] for size in sizes]
    if len({*texts}) > 1:
        texts = [f"{text} ({name})" for text, name in zip(texts, names, strict=True)]
    return f"{comma_list(list(dict.fromkeys(texts)))} {shown_unit(unit)}"


def argument(frame: SessionFit, effect: Learned) -> Array:
    """Return the coordinate of a learned effect in the positions, (n, a)."""
    values = coordinate_values(effect, frame)
    return values if effect.coordinate in (*OF_EACH, "angle") else values[:, :1]


@dataclass(frozen=True)
class _Functions:
    """Functions of the coordinate of an effect, in the residuals of a fit without it.

    Attributes
    ----------
    frame : SessionFit
    residuals : Residuals, beside what else was found
    effect : Learned
    arguments : (n, a) array, the coordinate
    """

    frame: SessionFit
    residuals: Residuals
    effect: Learned
    arguments: Array

    def _residual_functions(self, form: Form, settings: Array) -> tuple[Array, Array]:
        """What the model leaves of a form with t settings, (t, m, c, k), and its share, (t,)."""
        phi = [form.basis(s, self.arguments) for s in settings]
        functions = less_its_mean(np.concatenate(phi, axis=-1))
        rows = function_rows(self.frame, self.effect.target, functions)
        shape = len(rows), -1, len(settings), phi[0].shape[-1]
        both = (rows, self.residuals.project(rows))
        rows, left = (np.moveaxis(one.reshape(shape), 2, 0) for one in both)
        whole, seen = (np.sum(one**2, axis=(1, 2, 3)) for one in (rows, left))
        return left, seen / np.where(whole > 0, whole, np.inf)

    def densities(self, form: Form, evidence: Evidence) -> Array:
        """Log density of the residuals with each setting (t,) of a form; −inf if none shows."""
        z, logs = self.residuals.z, []
        for settings in np.array_split(form.settings, -(-len(form.settings) // AT_ONCE)):
            left, share = self._residual_functions(form, settings)
            columns = left.reshape(*left.shape[:2], -1)
            norms = np.linalg.norm(columns, axis=1)
            sizes = np.broadcast_to(norms.max(axis=1, keepdims=True), norms.shape)
            _, basis, rank = spans(columns, sizes, RULES.visible)
            dims = np.where(share > RULES.visible_shape, rank, 0)
            parts = np.sum((z @ basis) ** 2, axis=1)
            density = evidence.spaces_density(parts, np.maximum(dims, 1), float(z @ z))
            logs.append(np.where(dims > 0, density, -np.inf))
        return np.concatenate(logs)

    def density_of_others(self, place: Place, evidence: Evidence) -> float:
        """Log density under any smooth function, even over its smoothness."""
        z, effect = self.residuals.z, self.effect
        like = WAVES.get(effect.coordinate, effect.coordinate), effect.target
        tried = weigh_place(place, self.frame, self.residuals, z[None], evidence)
        shapes = [one for one in tried if (one.effect.coordinate, one.effect.target) == like]
        square = np.array([z @ z])
        if not shapes:
            return float(logsumexp(evidence.noise_density(square)))
        along = [(z @ one.vectors)[None] ** 2 for one in shapes]
        shares = [one.shares for one in shapes]
        return float(log_mean(evidence.shapes_density(along, shares, square)[0]))

    def fit(
        self, form: Form, setting: float, components: tuple[int, ...]
    ) -> tuple[Array, Array, tuple[int, ...]]:
        """Fit a form to some components.

        Returns
        -------
        sizes, sigmas : (c,) arrays, amplitude of a sine, or how far another form goes
        taking : components that take part; the most significant one if none does
        """
        z = self.residuals.z
        left = self._residual_functions(form, np.array([setting]))[0][0][:, [*components]]
        m, count, k = left.shape
        inverse = np.linalg.pinv(left.reshape(m, -1), rcond=RULES.visible)
        values = inverse @ z
        rest = z - left.reshape(m, -1) @ values
        freedom = max(self.residuals.redundancy - len(values), 1)
        cofactors = (inverse @ inverse.T).reshape(count, k, count, k) * (rest @ rest) / freedom
        sizes, variances, squares = np.zeros((3, count))
        for i, a in enumerate(values.reshape(count, k)):
            own, slope = cofactors[i, :, i], self._slope(form, setting, a, components[i])
            sizes[i], variances[i] = slope @ a, slope @ own @ slope
            squares[i] = a @ np.linalg.pinv(own) @ a / k
        least = min(f_distribution.isf(RULES.level_component, k, freedom), squares.max())
        taking = tuple(components[i] for i in np.flatnonzero(squares >= least))
        return sizes, np.sqrt(variances), taking

    def _slope(self, form: Form, setting: float, a: Array, component: int) -> Array:
        """Derivatives by the coefficients a (k,) of an amplitude, or of how far a form goes."""
        if form.is_sine:
            return a / np.linalg.norm(a)
        phi = form.basis(setting, self.arguments[:, min(component, self.arguments.shape[1] - 1)])
        h = phi @ a
        return np.asarray(phi[np.argmax(h)] - phi[np.argmin(h)])


# --- forms ---------------------------------------------------------------------------------------

MAX_PLACES = 60
"""Places of a step that are tried at most."""
MOST_CYCLES, EACH = 10.0, 3
"""Periods of a sine in the range of its coordinate at most; each needs as many different values."""
DISTINCT_VALUES = 100
"""Parts of its range in which values of a coordinate count as one."""
PERIOD_STEP = 1 / 16
"""Step of the number of periods that are tried."""
TURNS = {1: "once per turn", 2: "twice per turn", 3: "three times per turn",
         4: "four times per turn"}  # fmt: skip
"""Harmonics of an angle."""
POWERS = {1: "in proportion to it", 2: "with its square", 3: "with its cube"}
"""Powers of a coordinate that has a zero."""
POLYNOMIALS = {1: "in a straight line", 2: "as a parabola", 3: "as a cubic"}
"""Of a coordinate that has none."""
PARTS = np.geomspace(0.03, 1.0, 80)
"""Constants of an exponential, in ranges of the coordinate."""


@dataclass(frozen=True)
class Form:
    """A form of functions h(c) = Σ_j a_j φ_j(c; s).

    Attributes
    ----------
    words : str, with a place for the setting s if it has one
    basis : callable, φ of s and of c (...), (..., k)
    settings : (t,) array
    setting_text : callable, says a setting
    is_sine : bool, of which the amplitude is told; of others it is how much they go up and down
    """

    words: str
    basis: Callable[[float, Array], Array]
    settings: Array = field(default_factory=lambda: np.zeros(1))
    setting_text: Callable[[float], str] = str
    is_sine: bool = False

    def text(self, setting: float) -> str:
        """Say it with a setting."""
        return self.words.format(self.setting_text(setting))


def forms(coordinate: str, c: Array) -> Iterator[Form]:
    """Forms that a function of a coordinate with the values c (n, a) may have."""
    of, values = coordinate_of(coordinate), distinct(c)
    low, high, length = values[0], values[-1], np.ptp(values)
    several = len(values) > EACH  # otherwise a line or a parabola is all that shows
    if several:
        yield _step(of, c)
    if several and coordinate in ANGLES:
        for k, words in TURNS.items():
            yield Form(words, _sine, np.array([float(k)]), is_sine=True)
    elif several:
        cycles = np.arange(1.0, min(MOST_CYCLES, (len(values) - 1) / EACH) + 0.1, PERIOD_STEP)
        if len(cycles):
            words, turns = "as a sine with a period of {}", 2 * np.pi * cycles / length
            yield Form(words, _sine, turns, lambda turn: of.by(2 * np.pi / turn), is_sine=True)
        if of.is_course:
            words = "decaying with a time constant of {}"
            yield Form(words, lambda s, x: np.exp((low - x[..., None]) / s), length * PARTS, of.by)
    if several and of.has_zero:
        for p, words in POWERS.items():
            yield Form(words, partial(_powers, np.array([p]), 0.0, 1.0))
        return
    middle, half = (low + high) / 2, length / 2
    for p, words in POLYNOMIALS.items():
        if p < len(values):
            yield Form(words, partial(_powers, np.arange(1, p + 1), middle, half))


def distinct(c: Array) -> Array:
    """Values of a coordinate that differ by more than a small part of its range."""
    values = np.unique(c)
    part = np.floor((values - values[0]) / np.ptp(values) * DISTINCT_VALUES * (1 - 1e-9))
    chosen = values[np.diff(part, prepend=-1) > 0]
    chosen[-1] = values[-1]
    return chosen


def _step(of: Coordinate, c: Array) -> Form:
    """A step between any two values of a coordinate."""
    values = np.unique(c)
    between = (values[1:] + values[:-1]) / 2
    some = np.unique(np.linspace(0, len(between) - 1, MAX_PLACES).round().astype(int))

    def gap(place: float) -> str:
        after = int(np.searchsorted(values, place))
        return f"{of.at(values[after - 1])} and {of.at(values[after])}"

    def beyond(place: float, x: Array) -> Array:
        return np.asarray(x > place, dtype=float)[..., None]

    return Form("in a step between {}", beyond, between[some], gap)


def _powers(p: NDArray[np.int_], middle: float, half: float, _: float, x: Array) -> Array:
    return np.asarray(((x[..., None] - middle) / half) ** p)


def _sine(turn: float, x: Array) -> Array:
    return np.stack([np.sin(turn * x), np.cos(turn * x)], axis=-1)
