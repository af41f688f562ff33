"""Formulas for what a learned function may be: as a person would write them, ranked by evidence.

A form, such as a parabola or a sine with a free period, is a few functions of the coordinate. With
each of its settings, for some of the axes or alike in all of them, it is a space of residuals, and
is weighed as all hypotheses of the diagnosis are (`accelstudy.diagnosis.evidence.size`). Against
the forms stands any other smooth function, which is as probable at first as all of them together.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import softmax

from accelstudy.basics.units import attitude_unit, shown_unit, to_attitude
from accelstudy.basics.wording import comma_list, estimate, number
from accelstudy.diagnosis.evidence.size import Evidence, log_sum
from accelstudy.diagnosis.space.examined import Frame
from accelstudy.diagnosis.space.residuals import VISIBLE
from accelstudy.diagnosis.space.shapes import (
    EDGE,
    HARMONICS,
    PAIRS,
    SINES,
    SURVIVES,
    Course,
    LearnedShapes,
    _spectrum,
    function_rows,
    less_its_mean,
)
from accelstudy.diagnosis.space.signatures import Moment
from accelstudy.leveling.angles import wrapped

Array = NDArray[np.float64]
Choice = tuple[int, ...]
"""Components that take part."""

SURE_OF = 0.9
"""Posterior from which on a component takes part."""
ALIKE = 0.25
"""Prior probability that one function is that of all components; else each has its own."""
WORTH = 0.01
"""Posterior from which on a formula is worth a line."""
PLACES = 40
"""Places of a step that are tried at most."""
MOST_CYCLES, EACH = 10.0, 3
"""Periods of a sine in the range of its coordinate at most; each needs as many different values."""
TURNS = {1: "once per turn", 2: "twice per turn", 3: "three times per turn",
         4: "four times per turn", 5: "five times per turn", 6: "six times per turn"}  # fmt: skip
"""Harmonics of an angle."""
POWERS = {1: "in proportion to it", 2: "with its square", 3: "with its cube",
          4: "with its fourth power", 5: "with its fifth power"}  # fmt: skip
"""Powers of a coordinate that has a zero."""
POLYNOMIALS = {1: "in a straight line", 2: "as a parabola", 3: "as a cubic"}
"""Of a coordinate that has none."""


@dataclass(frozen=True)
class Coordinate:
    """How people see a coordinate.

    Attributes
    ----------
    words : str
    unit, step : str, of its values and of their differences
    size : float, SI size of that unit
    has_zero : bool, whether its zero means something
    """

    words: str
    unit: str
    step: str
    size: float = 1.0
    has_zero: bool = False

    def at(self, value: float) -> str:
        """Show a value."""
        return f"{number(value / self.size)} {self.unit}"

    def by(self, value: float) -> str:
        """Show a difference of values."""
        return f"{number(value / self.size)} {self.step}"


def coordinate_of(name: str) -> Coordinate:
    """Describe a coordinate."""
    if name in ANGLES:
        unit = attitude_unit()
        return Coordinate(ANGLES[name], unit, unit, float(1 / to_attitude(1.0)))
    return COORDINATES[name]


ANGLES = {"angle": "the angle", "yaw": "the yaw"}
FORCE = ("m/s²", "m/s²", 1.0, True)
COORDINATES = {
    "force": Coordinate("the force along the same axis", *FORCE),
    "others": Coordinate("the forces along the other axes", *FORCE),
    "previous": Coordinate("the force in the position before", *FORCE),
    "next": Coordinate("the step to the next position", *FORCE),
    "vibration": Coordinate("the vibration", *FORCE),
    "temperature": Coordinate("the temperature", "°C", "K"),
    "dT/dt": Coordinate("the rate of the temperature", "K/min", "K/min", 1 / 60, has_zero=True),
    "time": Coordinate("the time", "min", "min", 60.0),
    "order": Coordinate("the number of the position", "", "positions"),
}
"""Coordinates that are no angles."""


@dataclass(frozen=True)
class Target:
    """What depends on a coordinate.

    Attributes
    ----------
    words : str, with a place for the components
    components : tuple of str
    unit : str, SI
    """

    words: str
    components: tuple[str, ...]
    unit: str


XYZ = ("x", "y", "z")
TARGETS = {
    "bias": Target("the bias of {}", XYZ, "m/s^2"),
    "scale": Target("the scale of {}", XYZ, "1"),
    "square": Target("the quadratic scale of {}", XYZ, "s^2/m"),
    "reading": Target("the robot's reading of {}", ("roll", "pitch"), "rad"),
    "tilt": Target("the tilt {} of the robot's base", ("a", "b"), "rad"),
}


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
    components : tuple of str, that may depend on the coordinate
    axes : tuple of str, those that do
    subject : str, what depends on what: "the bias of x and y depends on the yaw"
    formulas : tuple of Formula, most probable first; the last is any other smooth function
    """

    components: tuple[str, ...]
    axes: tuple[str, ...]
    subject: str
    formulas: tuple[Formula, ...]


def ranked(frame: Frame, evidence: Evidence, place: tuple[str, str]) -> Ranking:
    """Rank the formulas for a target that is a function of a coordinate.

    Parameters
    ----------
    frame : Frame, of the fit without the function
    evidence : Evidence
    place : (str, str), the coordinate and the target
    """
    return _Library(frame, evidence, *place).ranking()


# --- the forms ----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Form:
    """A form of functions h(c) = Σ_j a_j φ_j(c; s).

    Attributes
    ----------
    said : callable, says it with a setting s
    basis : callable, φ of s and of c (...), (..., k)
    settings : sequence of float; any one where there is none
    weight : float, prior
    is_sine : bool, of which the amplitude is told; of others it is how much they go up and down
    smooth : bool, whether it changes smoothly with its setting
    """

    said: Callable[[float], str]
    basis: Callable[[float, Array], Array]
    settings: Sequence[float] = (0.0,)
    weight: float = 1.0
    is_sine: bool = False
    smooth: bool = False


def forms(coordinate: str, c: Array) -> Iterator[Form]:
    """Forms that a function of a coordinate with the values c (n, a) may have."""
    of, values = coordinate_of(coordinate), np.unique(c)
    low, high = float(values[0]), float(values[-1])
    span, middle = high - low, (high + low) / 2
    half = span / 2

    def power(p: float, x: Array) -> Array:
        return (x[..., None] / np.abs(c).max()) ** p

    def polynomial(p: float, x: Array) -> Array:
        return ((x[..., None] - middle) / half) ** np.arange(1, p + 1)

    if coordinate in ANGLES:
        for k, said in TURNS.items():
            yield Form(lambda s, said=said: said, _sines, (k,), 1 / k, is_sine=True)
        once_twice = partial(_sines, orders=(1, 2))
        yield Form(lambda s: "once and twice per turn", once_twice, (1.0,), 0.5)
    else:
        cycles = np.arange(0.75, min(MOST_CYCLES, (len(values) - 1) / EACH) + 0.1, 0.25)
        turns = 2 * np.pi * cycles / span

        def period(turn: float) -> str:
            return of.by(2 * np.pi / turn)

        if len(turns):
            yield Form(lambda s: f"as a sine with a period of {period(s)}", _sines, turns,
                       is_sine=True, smooth=True)  # fmt: skip
            repeated = partial(_sines, orders=(1, 2, 3))
            yield Form(lambda s: f"periodically every {period(s)}, in another form than a sine",
                       repeated, turns[cycles <= cycles[-1] / 3 + 1], smooth=True)  # fmt: skip
    if of.has_zero:
        for p, said in POWERS.items():
            yield Form(lambda s, said=said: said, power, (p,))
        if low < 0 < high:
            yield Form(lambda s: "with its absolute value", lambda s, x: np.abs(x)[..., None])
            yield Form(lambda s: "by its sign alone", lambda s, x: np.sign(x)[..., None])
            yield Form(lambda s: "with its square, with its sign",
                       lambda s, x: (x * np.abs(x))[..., None])  # fmt: skip
            widths = np.linspace(0.1, 0.8, 8) * np.abs(c).max()
            yield Form(lambda s: f"beyond ±{of.at(s)} only", _beyond, widths, smooth=True)
    else:
        for p, said in POLYNOMIALS.items():
            yield Form(lambda s, said=said: said, polynomial, (p,))
    if coordinate in ("time", "order", "vibration"):
        start = min(low, 0.0) if of.has_zero else low
        yield Form(lambda s: "with its square root",
                   lambda s, x: np.sqrt(np.maximum(x[..., None] - start, 0)))  # fmt: skip
    if coordinate not in ANGLES:
        constants = np.geomspace(0.03, 1.5, 12) * span
        if coordinate in ("time", "order"):
            yield Form(lambda s: f"decaying with a time constant of {of.by(s)}",
                       lambda s, x: np.exp((low - x[..., None]) / s), constants,
                       smooth=True)  # fmt: skip
        else:
            for sign, end, verb in ((1, high, "growing"), (-1, low, "decaying")):
                yield Form(lambda s, verb=verb: f"{verb} by the factor e every {of.by(s)}",
                           lambda s, x, sign=sign, end=end: np.exp(sign * (x[..., None] - end) / s),
                           constants, 0.5, smooth=True)  # fmt: skip
    between = (values[1:] + values[:-1]) / 2
    steps = between[np.unique(np.linspace(0, len(between) - 1, PLACES).round().astype(int))]

    def gap(s: float) -> str:
        i = int(np.searchsorted(values, s))
        return f"in a step between {of.at(values[i - 1])} and {of.at(values[i])}"

    yield Form(gap, lambda s, x: (x > s)[..., None].astype(float), steps)
    inner = np.linspace(low, high, 13)[1:-1]
    if len(values) > EACH:
        yield Form(lambda s: f"in a straight line from {of.at(s)} on",
                   lambda s, x: np.maximum(x[..., None] - s, 0), inner, 0.5, smooth=True)  # fmt: skip
        yield Form(lambda s: f"in a straight line up to {of.at(s)}",
                   lambda s, x: np.minimum(x[..., None] - s, 0), inner, 0.5, smooth=True)  # fmt: skip
        for share in (0.06, 0.15):
            yield Form(lambda s: f"in a bump at {of.at(s)}",
                       partial(_bump, share * span), np.linspace(low, high, 25), 0.5,
                       smooth=True)  # fmt: skip


def _beyond(width: float, x: Array) -> Array:
    """What is beyond a dead band."""
    return (np.sign(x) * np.maximum(np.abs(x) - width, 0))[..., None]


def _bump(width: float, at: float, x: Array) -> Array:
    return np.exp(-(((x[..., None] - at) / width) ** 2) / 2)


def smooth(coordinate: str, c: Array) -> tuple[Callable[[Array], Array], Array]:
    """Functions of a coordinate with the values c (n, a), (..., k), and prior variances (p, k)."""
    if coordinate in ANGLES:
        k = np.arange(1, HARMONICS + 1)
        return partial(_sines, 1.0, orders=k), np.tile(_spectrum(k), 2)
    low, high = float(c.min()), float(c.max())
    omega = np.pi / (2 * EDGE) * np.arange(1, SINES + 1)

    def basis(x: Array) -> Array:
        scaled = (2 * x[..., None] - low - high) / (high - low)
        return np.asarray(np.sin(omega * (scaled + EDGE)))

    return basis, _spectrum(omega)


def _sines(turn: float, x: Array, orders: ArrayLike = 1) -> Array:
    """Sines and cosines of an angle and of its multiples."""
    phase = turn * x[..., None] * np.atleast_1d(orders)
    return np.concatenate([np.sin(phase), np.cos(phase)], axis=-1)


# --- their evidence -----------------------------------------------------------------------------


class _Library:
    """Forms of a function of a coordinate, in the residuals of a fit without it."""

    def __init__(self, frame: Frame, evidence: Evidence, coordinate: str, target: str) -> None:
        self.frame, self.evidence = frame, evidence
        self.coordinate, self.target = coordinate, target
        self.z = frame.residuals.z
        self.at = argument(frame, coordinate)
        self.c = self.at(Moment(frame.hold))
        self.components = TARGETS[target].components
        if coordinate == "others":
            self.components = tuple(XYZ[i] + XYZ[j] for i, j in PAIRS)
        places = range(len(self.components))
        most = 1 if coordinate == "others" else len(places)
        some = [chosen for k in range(1, most + 1) for chosen in combinations(places, k)]
        self.choices: list[Choice] = [*some, *([tuple(places)] if most == 1 else [])]
        self.prior = np.log([*([(1 - ALIKE) / len(self.choices)] * len(self.choices)), ALIKE])

    def rows(self, basis: Callable[[Array], Array]) -> Array:
        """What functions do to the conditions of unit weight, by components, (m, c, k)."""

        def course(now: Moment) -> Array:
            return basis(self.at(now))

        target = "bias of the others" if self.coordinate == "others" else self.target
        at_zero = partial(less_its_mean, course, basis(self.c).mean(axis=0))
        rows = function_rows(self.frame, target, at_zero)
        return rows.reshape(len(rows), len(self.components), -1)

    def spaces(self, rows: Array) -> tuple[Array, NDArray[np.int_]]:
        """Square of the residuals in the space of each choice, and its dimension, each (s,).

        Those of choices with a component that the model absorbs are −1 and 0.
        """
        m, count, k = rows.shape
        left = self.frame.residuals.project(rows.reshape(m, -1))
        size = np.linalg.norm(rows.reshape(m, -1), axis=0)
        size[size == 0] = 1.0
        shown = left / size
        gram, seen = shown.T @ shown, shown.T @ self.z
        each = np.diag(gram).reshape(count, k).sum(axis=1) > SURVIVES * k
        parts, dims = [], []
        for choice in self.choices:
            which = np.concatenate([np.arange(i * k, (i + 1) * k) for i in choice])
            known = all(each[i] for i in choice)
            part, dim = _part(gram[np.ix_(which, which)], seen[which]) if known else (-1.0, 0)
            parts.append(part)
            dims.append(dim)
        # One function for all: the same coefficients in each component.
        together = (np.eye(k)[None] * size.reshape(count, k)[:, None]).reshape(count * k, k)
        norm = np.linalg.norm(together, axis=0)
        together /= norm
        part, dim = _part(together.T @ gram @ together, together.T @ seen)
        return np.array([*parts, part]), np.array([*dims, dim])

    def of_form(self, form: Form) -> Array:
        """Log density of the residuals under each setting and choice, with its prior, (t, s)."""
        found = [self.spaces(self.rows(partial(form.basis, s))) for s in form.settings]
        parts, dims = (np.stack(each) for each in zip(*found, strict=True))
        squares = self.z @ self.z
        logs = self.evidence.of_spaces(parts.ravel(), np.maximum(dims, 1).ravel(), squares)
        logs = np.where(dims > 0, logs.reshape(dims.shape), -np.inf)
        return logs + self.prior - np.log(len(form.settings))

    def of_smooth(self) -> Array:
        """The same for any smooth function, by its smoothness."""
        basis, priors = smooth(self.coordinate, self.c)
        m, rows = len(self.z), self.rows(basis)
        left = self.frame.residuals.project(rows.reshape(m, -1)).reshape(rows.shape)
        logs = np.full((len(priors), len(self.choices) + 1), -np.inf)
        for i, prior in enumerate(priors):
            scaled = left * np.sqrt(prior)
            whole = rows * np.sqrt(prior)
            shares = np.sum(scaled**2, axis=(0, 2)) / np.sum(whole**2, axis=(0, 2))
            roots, places = [], []
            for j, choice in enumerate([*self.choices, None]):
                if choice is None:
                    roots.append(scaled.sum(axis=1))
                elif all(shares[k] > SURVIVES for k in choice):
                    roots.append(scaled[:, list(choice)].reshape(m, -1))
                else:
                    continue
                places.append(j)
            shapes = LearnedShapes._of([("", "")] * len(roots), np.ones(len(roots)), roots, m)
            along = shapes.by_shape(shapes.squares(self.z[None]))
            total = np.array([self.z @ self.z])
            logs[i, places] = self.evidence.of_shapes(along, shapes.shares, total)[0]
        return logs + self.prior - np.log(len(priors))

    # --- what is said ---------------------------------------------------------------------------

    def ranking(self) -> Ranking:
        """Rank all forms, and any other smooth function."""
        all_forms = list(forms(self.coordinate, self.c))
        logs = [self.of_form(form) for form in all_forms]
        shown = [i for i, log in enumerate(logs) if np.isfinite(log).any()]
        all_forms, logs = [all_forms[i] for i in shown], [logs[i] for i in shown]
        weights = np.log([form.weight for form in all_forms])
        together = float(log_sum(weights))
        logs = [log + weight - together for log, weight in zip(logs, weights, strict=True)]
        logs.append(self.of_smooth())
        posterior = softmax([np.logaddexp.reduce(log.ravel()) for log in logs])
        choice = self._axes(logs)
        best = sorted(range(len(all_forms)), key=lambda i: -posterior[i])
        formulas = [
            Formula(self._said(all_forms[i], logs[i], choice), float(posterior[i]))
            for n, i in enumerate(best)
            if posterior[i] >= WORTH or n == 0
        ]
        formulas.append(Formula("as another smooth function", float(posterior[-1])))
        return Ranking(
            self.components,
            tuple(self.components[i] for i in choice),
            self._subject(choice),
            tuple(sorted(formulas, key=lambda one: -one.posterior)),
        )

    def _axes(self, logs: Sequence[Array]) -> Choice:
        """Components that take part for sure; if none does, the most probable ones."""
        by_choice = softmax(np.logaddexp.reduce(np.concatenate(logs), axis=0))
        everything = tuple(range(len(self.components)))
        taking = np.zeros(len(everything))
        for choice, p in zip([*self.choices, everything], by_choice, strict=True):
            taking[list(choice)] += p
        sure = tuple(np.flatnonzero(taking >= SURE_OF).tolist())
        return sure or [*self.choices, everything][int(np.argmax(by_choice))]

    def _subject(self, choice: Choice) -> str:
        """Say what depends on what."""
        names, of = [self.components[i] for i in choice], coordinate_of(self.coordinate).words
        if self.coordinate == "others":
            if len(choice) > 1:
                return f"the bias of all axes depends on {of}"
            i, j = PAIRS[choice[0]]
            return f"the bias of {XYZ[i]} depends on the force along {XYZ[j]}"
        all_of_three = len(names) == len(XYZ)
        which = "all axes" if all_of_three else comma_list(names)
        return f"{TARGETS[self.target].words.format(which)} depends on {of}"

    def _said(self, form: Form, logs: Array, choice: Choice) -> str:
        """Say a form, with its best setting and its size."""
        alike = len(choice) > 1 and logs[:, -1].max() > logs[:, :-1].max()
        setting = float(form.settings[int(np.argmax(logs.max(axis=1)))])
        if form.smooth:
            setting = self._sharpened(form, setting, choice, alike)
        rows = self.rows(partial(form.basis, setting))[:, list(choice)]
        if alike:
            rows = rows.sum(axis=1, keepdims=True)
        m, count, k = rows.shape
        left = self.frame.residuals.project(rows.reshape(m, -1))
        inverse = np.linalg.pinv(left, rcond=VISIBLE)
        values = (inverse @ self.z).reshape(count, k)
        freedom = max(self.evidence.redundancy - count * k, 1)
        square = float(np.sum((self.z - left @ values.ravel()) ** 2)) / freedom
        cofactors = (inverse @ inverse.T).reshape(count, k, count, k) * square
        sizes = []
        for i, a in enumerate(values):
            q = cofactors[i, :, i]
            if form.is_sine:
                size = float(np.linalg.norm(a))
                by = a / size
            else:
                phi = form.basis(setting, of_each(self.coordinate, self.c, len(XYZ))[:, choice[i]])
                by = phi[np.argmax(phi @ a)] - phi[np.argmin(phi @ a)]
                size = float(by @ a)
            sizes.append(estimate(size, float(np.sqrt(by @ q @ by)), TARGETS[self.target].unit)[0])
        unit = shown_unit(TARGETS[self.target].unit)
        if len(set(sizes)) == 1:
            shown = f"{sizes[0]} {unit}"
        else:
            each = zip(sizes, choice, strict=True)
            shown = f"{comma_list([f'{s} ({self.components[i]})' for s, i in each])} {unit}"
        return f"{form.said(setting)}, {'' if form.is_sine else 'by '}{shown}"

    def _sharpened(self, form: Form, start: float, choice: Choice, alike: bool) -> float:
        """Search the setting of a form between those beside the best one."""
        from scipy.optimize import minimize_scalar  # slow to import, and seldom needed

        place = len(self.choices) if alike else self.choices.index(choice)
        settings = sorted(form.settings)
        i = settings.index(start)
        ends = settings[max(i - 1, 0)], settings[min(i + 1, len(settings) - 1)]

        def lost(setting: float) -> float:
            return -float(self.spaces(self.rows(partial(form.basis, setting)))[0][place])

        least = minimize_scalar(lost, bounds=ends, method="bounded")
        return float(least.x) if least.fun < lost(start) else start


def _part(gram: Array, seen: Array) -> tuple[float, int]:
    """Square of the residuals in the space of columns of about unit length, and its dimension."""
    values, vectors = np.linalg.eigh(gram)
    kept = values > VISIBLE**2
    return float(np.sum((seen @ vectors[:, kept]) ** 2 / values[kept])), int(kept.sum())


def of_each(coordinate: str, c: Array, count: int) -> Array:
    """Coordinate of each of `count` components, (n, count), of those that there are, (n, a)."""
    if coordinate == "others":
        return c[:, [j for _, j in PAIRS]]
    return np.broadcast_to(c, (len(c), count)) if c.shape[1] == 1 else c


def argument(frame: Frame, coordinate: str) -> Course:
    """Return a coordinate of the holds as a function of the moment, (n, a)."""
    hold, f = frame.hold, frame.sensed
    order = "order" if hold.time is None else "time"
    if coordinate in ("force", "others"):
        return lambda now: f
    if coordinate == "angle":
        return lambda now: frame.angles
    if coordinate == "previous":
        return lambda now: np.concatenate([f[:1], f[:-1]])
    if coordinate == "next":
        return lambda now: np.append(f[1:], f[-1:], 0) - f
    if coordinate == "dT/dt":
        rates = np.diff(hold.temperature) / np.diff(hold.column(order))
        return lambda now: np.append(rates[:1], rates)[:, None]
    if coordinate == "yaw":
        return lambda now: wrapped(now.yaw)[:, None]
    return lambda now: getattr(now, order if coordinate == "time" else coordinate)[:, None]
