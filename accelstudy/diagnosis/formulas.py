"""Formulas for what a learned function may be: as a person would write them, ranked by evidence.

A form, such as a parabola or a sine with a free period, is a few functions of the coordinate. With
each of its settings, for some of the axes or alike in all of them, it is a space of residuals, and
is weighed as all hypotheses of the diagnosis are (`accelstudy.diagnosis.evidence.size`). Beside the
forms stands any other smooth function, as probable at first as what no catalogue has.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.special import softmax

from accelstudy.basics.units import shown_unit
from accelstudy.basics.wording import comma_list, estimate
from accelstudy.diagnosis.decision.priors import UNKNOWN
from accelstudy.diagnosis.evidence.size import Evidence
from accelstudy.diagnosis.forms import TARGETS, Form, coordinate_of, forms, smooth
from accelstudy.diagnosis.space.examined import Frame
from accelstudy.diagnosis.space.residuals import VISIBLE
from accelstudy.diagnosis.space.shapes import SURVIVES, Course, function_rows, less_its_mean
from accelstudy.diagnosis.space.signatures import Moment
from accelstudy.effects.learned import ANGLES, OF_EACH, WAVES, Learned

Array = NDArray[np.float64]
Choice = tuple[int, ...]
"""Components that take part."""

OTHER = "as another smooth function"
SURE_OF = 0.9
"""Posterior from which on a component takes part."""
ALIKE = 0.25
"""Prior probability that one function is that of all components; else each has its own."""
WORTH = 0.01
"""Posterior from which on a formula is worth a line."""
KEPT = 1e-6
"""Least eigenvalue of a smooth function that counts, as a part of their sum."""


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


def ranked(frame: Frame, evidence: Evidence, effect: Learned, beside: Array) -> Ranking:
    """Rank the formulas for a learned function.

    Parameters
    ----------
    frame : Frame, of the fit without the function
    evidence : Evidence
    effect : Learned, which says of what the function is one
    beside : (m, l) array, basis of the space of what was found beside it
    """
    return _Library(frame, evidence, effect, beside).ranking()


def argument(frame: Frame, effect: Learned) -> Course:
    """Return the coordinate of a learned effect as a function of the moment, (n, a)."""
    name = WAVES.get(effect.coordinate, effect.coordinate)
    if name in (*ANGLES, *OF_EACH, "temperature rate"):
        values = np.stack(
            effect.arguments(tuple(frame.sensed.T), tuple(frame.angles.T), frame.hold), axis=1
        )
        values = values if name in (*OF_EACH, "angle") else values[:, :1]
        return lambda now: values
    return lambda now: getattr(now, name)[:, None]


class _Library:
    """Forms of a function of a coordinate, in the residuals of a fit without it."""

    def __init__(self, frame: Frame, evidence: Evidence, effect: Learned, beside: Array) -> None:
        self.frame, self.evidence, self.effect, self.beside = frame, evidence, effect, beside
        self.z = frame.residuals.z - beside @ (beside.T @ frame.residuals.z)
        self.at = argument(frame, effect)
        self.c = self.at(Moment(frame.hold))
        self.components = TARGETS[effect.target].components
        self.everything: Choice = tuple(range(len(self.components)))

    @cached_property
    def choices(self) -> list[Choice]:
        """Components that may take part, each with a function of its own."""
        sizes = range(1, len(self.everything) + 1)
        return [some for size in sizes for some in combinations(self.everything, size)]

    @cached_property
    def prior(self) -> Array:
        """Log prior of each choice, and of one function for all components, (s,)."""
        each = (1 - ALIKE) / len(self.choices)
        return np.log([*(each for _ in self.choices), ALIKE])

    # --- evidence -------------------------------------------------------------------------------

    def rows(self, basis: Callable[[Array], Array]) -> tuple[Array, Array]:
        """What functions do to the conditions of unit weight, and to the residuals, (m, c, k)."""

        def course(now: Moment) -> Array:
            return basis(self.at(now))

        varying = partial(less_its_mean, course, basis(self.c).mean(axis=0))
        rows = function_rows(self.frame, self.effect.target, varying)
        left = self.frame.residuals.project(rows)
        left -= self.beside @ (self.beside.T @ left)
        shape = len(rows), len(self.components), -1
        return rows.reshape(shape), left.reshape(shape)

    def products(self, left: Array, weights: Array) -> tuple[list[tuple[Array, Array]], Array]:
        """Products of functions (m, c, k) with each other and with the residuals, by choices.

        Returns
        -------
        list of ((l, l), (l,)) arrays, of the functions with some weights (c, k) : of each choice,
            and of one function for all
        (c,) array, square of what is left of each component
        """
        m, c, k = left.shape
        shown = (left * weights).reshape(m, -1)
        gram, seen = shown.T @ shown, shown.T @ self.z
        each = []
        for choice in self.choices:
            some = (np.array(choice)[:, None] * k + np.arange(k)).ravel()
            each.append((gram[np.ix_(some, some)], seen[some]))
        blocks = gram.reshape(c, k, c, k).sum(axis=(0, 2)), seen.reshape(c, k).sum(axis=0)
        return [*each, blocks], np.diag(gram).reshape(c, k).sum(axis=1)

    def spaces(self, basis: Callable[[Array], Array]) -> tuple[Array, NDArray[np.int_]]:
        """Square of the residuals in the space of each choice, and its dimension, each (s,).

        The dimension is zero where the model absorbs one of its components.
        """
        rows, left = self.rows(basis)
        size = np.linalg.norm(rows, axis=0)
        # One function for all has the same size in all.
        size = np.where(size.any(), np.sqrt(np.mean(size**2, axis=0)), 1.0)
        products, square = self.products(left, np.broadcast_to(1 / size, left.shape[1:]))
        shown = square > SURVIVES * left.shape[2]
        parts, dims = np.zeros(len(products)), np.zeros(len(products), dtype=int)
        for i, (gram, seen) in enumerate(products):
            if i < len(self.choices) and not shown[list(self.choices[i])].all():
                continue
            values, vectors = np.linalg.eigh(gram)
            kept = values > VISIBLE**2
            parts[i] = np.sum((seen @ vectors[:, kept]) ** 2 / values[kept])
            dims[i] = np.count_nonzero(kept)
        return parts, dims

    def of_form(self, form: Form) -> Array:
        """Log density of the residuals under each setting and choice, with its prior, (t, s)."""
        found = [self.spaces(partial(form.basis, setting)) for setting in form.settings]
        parts, dims = (np.stack(each) for each in zip(*found, strict=True))
        logs = self.evidence.of_spaces(
            parts.ravel(), np.maximum(dims, 1).ravel(), float(self.z @ self.z)
        )
        logs = np.where(dims > 0, logs.reshape(dims.shape), -np.inf)
        return np.asarray(logs + self.prior - np.log(len(form.settings)))

    def of_smooth(self) -> Array:
        """The same under any smooth function, by its smoothness."""
        basis, priors = smooth(self.effect.coordinate, self.c)
        rows, left = self.rows(basis)
        logs = np.full((len(priors), len(self.prior)), -np.inf)
        for row, prior in zip(logs, priors, strict=True):
            whole = np.einsum("mck,k->c", rows**2, prior)
            products, square = self.products(left, np.broadcast_to(np.sqrt(prior), rows.shape[1:]))
            along, shares, places = [], [], []
            for i, (gram, seen) in enumerate(products):
                some = list(self.choices[i]) if i < len(self.choices) else []
                if not (square[some] > SURVIVES * whole[some]).all():
                    continue
                values, vectors = np.linalg.eigh(gram)
                kept = values > KEPT * values.sum()
                along.append((seen @ vectors[:, kept])[None] ** 2 / values[kept])
                shares.append(values[kept] / values[kept].sum())
                places.append(i)
            row[places] = self.evidence.of_shapes(along, shares, np.array([self.z @ self.z]))[0]
        return np.asarray(logs + self.prior - np.log(len(priors)))

    # --- what is said ---------------------------------------------------------------------------

    def ranking(self) -> Ranking:
        """Rank all forms, and any other smooth function."""
        weighed = [(form, self.of_form(form)) for form in forms(self.effect.coordinate, self.c)]
        weighed = [(form, logs) for form, logs in weighed if np.isfinite(logs).any()]
        total = sum(form.weight for form, _ in weighed) / (1 - UNKNOWN)
        logs = [each + np.log(form.weight / total) for form, each in weighed]
        logs.append(self.of_smooth() + np.log(UNKNOWN))
        posterior = softmax([np.logaddexp.reduce(each, axis=None) for each in logs]).tolist()
        taking, alike = self._taking(logs), defaultdict[str, list[int]](list)
        for i, (form, _) in enumerate(weighed):
            alike[form.words].append(i)
        formulas = []
        for some in alike.values():
            best, together = max(some, key=posterior.__getitem__), sum(posterior[i] for i in some)
            if together >= WORTH:
                said = self._said(weighed[best][0], logs[best], taking)
                formulas.append(Formula(said, together))
        formulas.append(Formula(OTHER, posterior[-1]))
        names = [self.components[i] for i in taking]
        which = "all axes" if len(names) == len("xyz") else comma_list(names)
        subject = TARGETS[self.effect.target].words.format(which)
        return Ranking(
            axes=tuple(names),
            subject=f"{subject} depends on {coordinate_of(self.effect.coordinate).words}",
            formulas=tuple(sorted(formulas, key=lambda one: -one.posterior)),
        )

    def _taking(self, logs: Sequence[Array]) -> Choice:
        """Components that take part for sure; if none does, the most probable ones."""
        choices = [*self.choices, self.everything]
        by_choice = softmax(np.logaddexp.reduce(np.concatenate(logs), axis=0))
        each = [sum(p for one, p in zip(choices, by_choice, strict=True) if i in one)
                for i in self.everything]  # fmt: skip
        sure = tuple(i for i in self.everything if each[i] >= SURE_OF)
        return sure or choices[int(np.argmax(by_choice))]

    def _said(self, form: Form, logs: Array, taking: Choice) -> str:
        """Say a form, with its best setting and its size."""
        alike = taking == self.everything and logs[:, -1].max() > logs[:, :-1].max()
        place = len(self.choices) if alike else self.choices.index(taking)
        setting = self._sharpened(form, int(np.argmax(logs[:, place])), place)
        left = self.rows(partial(form.basis, setting))[1][:, list(taking)]
        if alike:
            left = left.sum(axis=1, keepdims=True)
        m, count, k = left.shape
        inverse = np.linalg.pinv(left.reshape(m, -1), rcond=VISIBLE)
        values = inverse @ self.z
        rest = self.z - left.reshape(m, -1) @ values
        freedom = max(self.evidence.redundancy - len(values), 1)
        cofactors = (inverse @ inverse.T).reshape(count, k, count, k) * (rest @ rest) / freedom
        unit, sizes = TARGETS[self.effect.target].unit, []
        for i, a in enumerate(values.reshape(count, k)):
            by = self._size(form, setting, a, taking[i])
            sigma = float(np.sqrt(by @ cofactors[i, :, i] @ by))
            sizes.append(estimate(float(by @ a), sigma, unit)[0])
        if len(set(sizes)) > 1:
            names = [self.components[i] for i in taking]
            sizes = [f"{size} ({name})" for size, name in zip(sizes, names, strict=True)]
        shown = comma_list(list(dict.fromkeys(sizes)))
        return f"{form.said(setting)}, {'' if form.is_sine else 'by '}{shown} {shown_unit(unit)}"

    def _size(self, form: Form, setting: float, a: Array, component: int) -> Array:
        """Derivatives by the coefficients a (k,) of an amplitude, or of how far a form goes."""
        if form.is_sine:
            return a / np.linalg.norm(a)
        phi = form.basis(setting, self.c[:, component if self.c.shape[1] > 1 else 0])
        h = phi @ a
        return np.asarray(phi[np.argmax(h)] - phi[np.argmin(h)])

    def _sharpened(self, form: Form, best: int, place: int) -> float:
        """Search the setting of a form between those beside the best one."""
        settings = [float(setting) for setting in form.settings]
        if not form.is_smooth:
            return settings[best]
        from scipy.optimize import minimize_scalar  # slow to import, and seldom needed

        def lost(setting: float) -> float:
            return -float(self.spaces(partial(form.basis, setting))[0][place])

        ends = settings[max(best - 1, 0)], settings[min(best + 1, len(settings) - 1)]
        least = minimize_scalar(lost, bounds=ends, method="bounded")
        return float(least.x) if least.fun < lost(settings[best]) else settings[best]
