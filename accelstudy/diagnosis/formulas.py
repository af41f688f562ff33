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
from accelstudy.diagnosis.decision.learned import coordinate_values
from accelstudy.diagnosis.decision.priors import UNKNOWN
from accelstudy.diagnosis.evidence.size import Evidence
from accelstudy.diagnosis.forms import TARGETS, Form, coordinate_of, forms, smooth
from accelstudy.diagnosis.space.examined import Frame
from accelstudy.diagnosis.space.residuals import VISIBLE
from accelstudy.diagnosis.space.shapes import SURVIVES, function_rows, less_its_mean
from accelstudy.effects.learned import ANGLES, OF_EACH, WAVES, Learned

Array = NDArray[np.float64]
Choice = tuple[int, ...]
"""Components that take part."""

OTHER = "as another smooth function"
SURE_OF = 0.9
"""Posterior from which on a component takes part."""
ALIKE = 0.25
"""Prior probability that one function is that of all components; else each has its own."""
AT_ONCE = 10_000_000
"""Numbers in one block of work, about."""
ROUNDS, FINER = 3, 4
"""How often the settings about the best one are tried more closely, and by how much."""
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


def argument(frame: Frame, effect: Learned) -> Array:
    """Return the coordinate of a learned effect in the positions, (n, a)."""
    name = WAVES.get(effect.coordinate, effect.coordinate)
    if name in (*ANGLES, *OF_EACH, "temperature rate"):
        values = coordinate_values(effect, frame)
        return values if name in (*OF_EACH, "angle") else values[:, :1]
    return frame.hold.column(name)[:, None]


class _Library:
    """Forms of a function of a coordinate, in the residuals of a fit without it."""

    def __init__(self, frame: Frame, evidence: Evidence, effect: Learned, beside: Array) -> None:
        self.frame, self.evidence, self.effect, self.beside = frame, evidence, effect, beside
        self.z = frame.residuals.z - beside @ (beside.T @ frame.residuals.z)
        self.c = argument(frame, effect)
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

    def rows(self, form: Callable[[Array], Array]) -> tuple[Array, Array]:
        """What functions do to the conditions of unit weight, and to the residuals, (m, c, k)."""
        varying = less_its_mean(form(self.c))
        rows = function_rows(self.frame, self.effect.target, varying)
        left = self.frame.residuals.project(rows)
        left -= self.beside @ (self.beside.T @ left)
        shape = len(rows), len(self.components), -1
        return rows.reshape(shape), left.reshape(shape)

    def products(self, shown: Array) -> tuple[list[tuple[Array, Array]], Array]:
        """Products of sets of functions (t, m, c, k) with each other and with the residuals.

        Returns
        -------
        list of ((t, l, l), (t, l)) arrays, of each choice, and of one function for all
        (t, c) array, square of what is left of each component
        """
        t, m, c, k = shown.shape
        columns = shown.reshape(t, m, -1)
        gram, seen = columns.swapaxes(1, 2) @ columns, self.z @ columns
        each = []
        for choice in self.choices:
            some = (np.array(choice)[:, None] * k + np.arange(k)).ravel()
            each.append((gram[:, some[:, None], some], seen[:, some]))
        together = gram.reshape(t, c, k, c, k).sum(axis=(1, 3)), seen.reshape(t, c, k).sum(axis=1)
        square = np.diagonal(gram, axis1=1, axis2=2).reshape(t, c, k).sum(axis=2)
        return [*each, together], square

    def spaces(self, form: Form, settings: Array) -> tuple[Array, NDArray[np.int_]]:
        """Square of the residuals in the space of each choice, and its dimension, each (t, s).

        The dimension is zero where the model absorbs one of the components.
        """
        t = len(settings)
        both = self.rows(lambda x: np.concatenate([form.basis(s, x) for s in settings], axis=-1))
        rows, left = (np.moveaxis(one.reshape(*one.shape[:2], t, -1), 2, 0) for one in both)
        # One size for all components: one function for all has the same in each.
        size = np.sqrt(np.mean(np.sum(rows**2, axis=1, keepdims=True), axis=2, keepdims=True))
        products, square = self.products(left / np.where(size > 0, size, 1.0))
        shown = square > SURVIVES * left.shape[3]
        parts, dims = np.zeros((2, t, len(products)))
        for i, (gram, seen) in enumerate(products):
            values, vectors = np.linalg.eigh(gram)
            kept = values > VISIBLE**2
            along = np.einsum("tj,tjl->tl", seen, vectors) ** 2
            parts[:, i] = np.sum(np.where(kept, along / np.where(kept, values, 1.0), 0.0), axis=1)
            of_all = shown[:, list(self.choices[i])].all(axis=1) if i < len(self.choices) else True
            dims[:, i] = np.where(of_all, np.count_nonzero(kept, axis=1), 0)
        return parts, dims.astype(int)

    def of_form(self, form: Form) -> tuple[Array, Array]:
        """Settings of a form, (t,), and the log density under each and each choice, (t, s).

        The densities contain the prior, which is even over the settings of the form. More of them
        are tried about the best one, which a large effect tells more closely.
        """
        count = len(form.settings)
        places, logs = np.arange(float(count)), self.densities(form, form.settings)
        step = 1.0
        for _ in range(ROUNDS if form.is_searched and count > 1 else 0):
            step /= FINER
            around = np.arange(1 - FINER, FINER)
            near = places[np.argmax(logs.max(axis=1))] + step * around[around != 0]
            near = np.setdiff1d(near[(near >= 0) & (near <= count - 1)], places)
            if not len(near):
                break
            settings = np.interp(near, np.arange(count), form.settings)
            order = np.argsort(np.concatenate([places, near]))
            logs = np.concatenate([logs, self.densities(form, settings)])[order]
            places = np.concatenate([places, near])[order]
        width = np.gradient(places)[:, None] if count > 1 else np.ones((1, 1))
        settings = np.interp(places, np.arange(count), form.settings)
        return settings, logs + self.prior + np.log(width / count)

    def densities(self, form: Form, settings: Array) -> Array:
        """Log density of the residuals under settings (t,) of a form and each choice, (t, s)."""
        functions = form.basis(settings[0], self.c[:1]).shape[-1] * len(self.components)
        blocks = -(-len(settings) * functions * len(self.z) // AT_ONCE)
        found = [self.spaces(form, some) for some in np.array_split(settings, blocks)]
        parts, dims = (np.concatenate(each) for each in zip(*found, strict=True))
        square = float(self.z @ self.z)
        logs = self.evidence.of_spaces(parts.ravel(), np.maximum(dims, 1).ravel(), square)
        return np.where(dims > 0, logs.reshape(dims.shape), -np.inf)

    def of_smooth(self) -> Array:
        """The same under any smooth function, by its smoothness."""
        form, priors = smooth(self.effect.coordinate, self.c)
        rows, left = self.rows(form)
        products, square = self.products(left * np.sqrt(priors)[:, None, None])
        shown = square > SURVIVES * np.einsum("mck,tk->tc", rows**2, priors)
        logs = np.full((len(priors), len(self.prior)), -np.inf)
        for t, row in enumerate(logs):
            along, shares, places = [], [], []
            for i, (gram, seen) in enumerate(products):
                if i < len(self.choices) and not shown[t, list(self.choices[i])].all():
                    continue
                values, vectors = np.linalg.eigh(gram[t])
                kept = values > KEPT * values.sum()
                along.append((seen[t] @ vectors[:, kept])[None] ** 2 / values[kept])
                shares.append(values[kept] / values[kept].sum())
                places.append(i)
            row[places] = self.evidence.of_shapes(along, shares, np.array([self.z @ self.z]))[0]
        return np.asarray(logs + self.prior - np.log(len(priors)))

    # --- what is said ---------------------------------------------------------------------------

    def ranking(self) -> Ranking:
        """Rank all forms, and any other smooth function."""
        found = [(form, *self.of_form(form)) for form in forms(self.effect.coordinate, self.c)]
        weighed = [one for one in found if np.isfinite(one[2]).any()]
        total = sum(form.weight for form, _, _ in weighed) / (1 - UNKNOWN)
        logs = [each + np.log(form.weight / total) for form, _, each in weighed]
        logs.append(self.of_smooth() + np.log(UNKNOWN))
        posterior = softmax([np.logaddexp.reduce(each, axis=None) for each in logs]).tolist()
        taking, alike = self._taking(logs), defaultdict[str, list[int]](list)
        for i, (form, _, _) in enumerate(weighed):
            alike[form.words].append(i)
        formulas = []
        for some in alike.values():
            best, together = max(some, key=posterior.__getitem__), sum(posterior[i] for i in some)
            if together >= WORTH:
                said = self._said(*weighed[best], taking)
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

    def _said(self, form: Form, settings: Array, logs: Array, taking: Choice) -> str:
        """Say a form, with its best setting and its size."""
        alike = taking == self.everything and logs[:, -1].max() > logs[:, :-1].max()
        place = len(self.choices) if alike else self.choices.index(taking)
        setting = float(settings[np.argmax(logs[:, place])])
        left = self.rows(partial(form.basis, setting))[1][:, list(taking)]
        if alike:
            left = left.sum(axis=1, keepdims=True)
        m, count, k = left.shape
        inverse = np.linalg.pinv(left.reshape(m, -1), rcond=VISIBLE)
        values = inverse @ self.z
        rest = self.z - left.reshape(m, -1) @ values
        freedom = max(self.evidence.redundancy - len(values), 1)
        cofactors = (inverse @ inverse.T).reshape(count, k, count, k) * (rest @ rest) / freedom
        unit = TARGETS[self.effect.target].unit
        by = [self._size(form, setting, a, i)
              for a, i in zip(values.reshape(count, k), taking, strict=False)]  # fmt: skip
        sigma = max(float(np.sqrt(d @ cofactors[i, :, i] @ d)) for i, d in enumerate(by))
        how_far = [float(d @ a) for d, a in zip(by, values.reshape(count, k), strict=True)]
        sizes = [estimate(size, sigma, unit)[0] for size in how_far]
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
