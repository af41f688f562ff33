"""Formulas for what a learned function may be: as a person would write them, ranked by evidence.

A form, such as a parabola or a sine with a free period, is a few functions of the coordinate. With
each of its settings it is a space of residuals, and is weighed as all hypotheses of the diagnosis
are (`accelstudy.diagnosis.evidence.size`). Beside the forms stands any other smooth function, as
probable at first as what no catalogue has.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp, softmax

from accelstudy.diagnosis.coordinates import ANGLES, coordinate_of
from accelstudy.diagnosis.decision.functions import weigh_place
from accelstudy.diagnosis.evidence.size import Evidence, log_mean
from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.space.frame import SessionFit
from accelstudy.diagnosis.space.residuals import Residuals
from accelstudy.diagnosis.space.shapes import Place, function_rows, less_its_mean
from accelstudy.effects.learned import WAVES, Learned

Array = NDArray[np.float64]

OTHER_FORM = "as another smooth function"
MIN_POSTERIOR = 0.01
"""Posterior from which on a formula is worth a line."""


class Formula(NamedTuple):
    """A formula for a learned function.

    Attributes
    ----------
    text : str, in plain words, such as "once per turn"
    posterior : float, given that something is missing that is a function of this coordinate
    """

    text: str
    posterior: float


def rank_formulas(
    frame: SessionFit,
    evidence: Evidence,
    effect: Learned,
    place: Place,
    arguments: Array,
    beside: Array,
) -> tuple[Formula, ...]:
    """Rank the formulas for a learned function; one of them is any other smooth function.

    Parameters
    ----------
    frame : SessionFit, of the fit without the function
    evidence : Evidence
    effect : Learned, which says of what the function is one
    place : Place, coordinate and target of the same
    arguments : (n, a) array, the coordinate in the positions
    beside : (m, l) array, basis of the space of what was found beside it
    """
    residuals = frame.residuals.orthogonal_to(beside)
    z, evidence = residuals.z, replace(evidence, redundancy=residuals.redundancy)
    texts, logs = list[str](), list[float]()
    for form in forms(effect.coordinate, arguments):
        bases = [
            _space(frame, residuals, effect.target, form.functions(setting, arguments))
            for setting in form.settings
        ]
        dims = np.array([basis.shape[1] for basis in bases])
        parts = np.array([np.sum((z @ basis) ** 2) for basis in bases])
        density = evidence.spaces_density(parts, np.maximum(dims, 1), z @ z)
        density[dims == 0] = -np.inf
        if dims.any():
            best = float(form.settings[np.argmax(density)])
            texts.append(form.words.format(form.setting_text(best)))
            logs.append(float(log_mean(density)))
    each = np.log((1 - RULES.prior_unknown) / max(len(logs), 1))
    other = _density_of_others(frame, residuals, evidence, effect, place)
    p = softmax([*(log + each for log in logs), other + np.log(RULES.prior_unknown)]).tolist()
    ranked = zip((*texts, OTHER_FORM), p, strict=True)
    formulas = [Formula(*one) for one in ranked if one[1] >= MIN_POSTERIOR or one[0] == OTHER_FORM]
    return tuple(sorted(formulas, key=lambda one: -one.posterior))


def _space(frame: SessionFit, residuals: Residuals, target: str, functions: Array) -> Array:
    """Basis (m, l) of what the model leaves of functions (n, a, k); no column if too little."""
    rows = function_rows(frame, target, less_its_mean(functions))
    left = residuals.project(rows)
    basis, sizes, _ = np.linalg.svd(left, full_matrices=False)
    seen = sizes > RULES.visible * np.linalg.norm(left, axis=0).max()
    enough = np.sum(left**2) > RULES.visible_shape * np.sum(rows**2)
    return np.asarray(basis[:, seen & enough])


def _density_of_others(
    frame: SessionFit, residuals: Residuals, evidence: Evidence, effect: Learned, place: Place
) -> float:
    """Log density of the residuals under any smooth function, even over its smoothness."""
    z, like = residuals.z, (WAVES.get(effect.coordinate, effect.coordinate), effect.target)
    tried = weigh_place(place, frame, residuals, z[None], evidence)
    shapes = [one for one in tried if (one.effect.coordinate, one.effect.target) == like]
    square = np.array([z @ z])
    if not shapes:
        return float(logsumexp(evidence.noise_density(square)))
    along = [(z @ one.vectors)[None] ** 2 for one in shapes]
    shares = [one.shares for one in shapes]
    return float(log_mean(evidence.shapes_density(along, shares, square)[0]))


# --- forms ---------------------------------------------------------------------------------------

MAX_STEPS = 60
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


class Form(NamedTuple):
    """A form of functions h(c) = Σ_j a_j φ_j(c; s).

    Attributes
    ----------
    words : str, with a place for the setting s if it has one
    functions : callable, φ of s and of c (...), (..., k)
    settings : (t,) array
    setting_text : callable, says a setting
    """

    words: str
    functions: Callable[[float, Array], Array]
    settings: Array = np.zeros(1)
    setting_text: Callable[[float], str] = str


def forms(coordinate: str, c: Array) -> Iterator[Form]:
    """Forms that a function of a coordinate with the values c (n, a) may have."""
    of, values, low, length = coordinate_of(coordinate), np.unique(c), c.min(), np.ptp(c)
    parts = (values - low) / length * DISTINCT_VALUES * (1 - 1e-9)
    count = len(np.unique(np.floor(parts)))
    several = count > EACH  # otherwise a line or a parabola is all that shows
    if several:
        between = (values[1:] + values[:-1]) / 2
        some = np.linspace(0, len(between) - 1, MAX_STEPS).round().astype(int)
        yield Form("in a step at {}", _step, between[np.unique(some)], of.at)
    if several and coordinate in ANGLES:
        for k, words in TURNS.items():
            yield Form(words, _sine, np.array([float(k)]))
    elif several:
        cycles = np.arange(1.0, min(MOST_CYCLES, (count - 1) / EACH) + 0.1, PERIOD_STEP)
        words, periods = "as a sine with a period of {}", length / cycles
        yield Form(words, lambda s, x: _sine(2 * np.pi / s, x), periods, of.by)
        if of.is_course:
            words = "decaying with a time constant of {}"
            yield Form(words, lambda s, x: np.exp((low - x[..., None]) / s), length * PARTS, of.by)
    if several and of.has_zero:
        for p, words in POWERS.items():
            yield Form(words, partial(_powers, np.array([p])))
    else:
        middle, half = (low + c.max()) / 2, length / 2
        for p, words in POLYNOMIALS.items():
            if p < count:
                powers = partial(_powers, np.arange(1, p + 1), middle=middle, half=half)
                yield Form(words, powers)


def _step(place: float, x: Array) -> Array:
    return np.asarray(x > place, dtype=float)[..., None]


def _sine(turn: float, x: Array) -> Array:
    return np.stack([np.sin(turn * x), np.cos(turn * x)], axis=-1)


def _powers(
    p: NDArray[np.int_], _: float, x: Array, middle: float = 0.0, half: float = 1.0
) -> Array:
    return np.asarray(((x[..., None] - middle) / half) ** p)
