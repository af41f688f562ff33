"""Sources of error of the foot of a pole: a registry in which each source is one small function.

To add one, write a function of a `Situation` that returns which inputs are wrong and by how much,
and register it with a title and a remedy.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.registry import Registry
from accelstudy.basics.units import STANDARD_GRAVITY
from accelstudy.pole.geometry import FORCE, PARAMETERS, Situation
from accelstudy.pole.setup import Setup

Array = NDArray[np.float64]


@dataclass(frozen=True)
class InputErrors:
    """Normal errors of the inputs that a source makes wrong.

    Attributes
    ----------
    inputs : tuple of str, as in `Situation.slope`
    covariance : (k, m, m) array
    shift : (k, m) array, mean of the errors
    """

    inputs: tuple[str, ...]
    covariance: Array
    shift: Array


def scatter(situation: Situation, inputs: tuple[str, ...], *sigma: Array | float) -> InputErrors:
    """Independent errors; each input has its standard deviation, a number or (k,)."""
    variance = np.stack(np.broadcast_arrays(*sigma, situation.tilt)[:-1], axis=-1) ** 2
    return InputErrors(inputs, variance[..., None] * np.eye(len(sigma)), np.zeros_like(variance))


@dataclass(frozen=True)
class Source:
    """A source of error.

    Attributes
    ----------
    name : str, of tables
    title : str, of figures and sentences
    remedy : str, advice that makes it smaller
    colour, hatch : str, in figures; red-green blind readers can distinguish the colours, too
    sensor : bool, whether it belongs to the tilt sensor
    errors : function of a `Situation`
    """

    name: str
    title: str
    remedy: str
    colour: str
    hatch: str
    sensor: bool
    errors: Callable[[Situation], InputErrors]


_REGISTRY: Registry[Source] = Registry("source of error")
Function = Callable[[Situation], InputErrors]


def source(
    name: str, title: str, remedy: str, colour: str, hatch: str = "", sensor: bool = False
) -> Callable[[Function], Function]:
    """Register a source of error."""

    def add(function: Function) -> Function:
        _REGISTRY.add(name, Source(name, title, remedy, colour, hatch, sensor, function))
        return function

    return add


def sources() -> tuple[Source, ...]:
    """All sources, in order."""
    return tuple(_REGISTRY.get(name) for name in _REGISTRY.names())


@source(
    "calibration",
    "calibration",
    "Calibrate in more positions, longer in each, or with a robot.",
    "#0072B2",
    sensor=True,
)
def calibration(situation: Situation) -> InputErrors:
    """Errors of the parameters with their full covariance, constant until the next calibration."""
    if (sigma := situation.sensor.tilt_sigma) is not None:
        return scatter(situation, ("roll", "pitch"), sigma, sigma)
    k, u = len(situation.tilt), situation.sensor.model.n_parameters
    covariance = np.broadcast_to(situation.sensor.covariance, (k, u, u))
    return InputErrors((PARAMETERS,), covariance, np.zeros((k, u)))


@source(
    "noise",
    "noise of the reading",
    "Average longer, or take a quieter sensor.",
    "#CC79A7",
    hatch="....",
    sensor=True,
)
def noise(situation: Situation) -> InputErrors:
    """Noise of the mean of a reading, equal on all axes."""
    sigma = situation.sensor.sheet.sigma_mean(situation.setup.averaging)
    return scatter(situation, (FORCE,), sigma, sigma, sigma)


@source(
    "drift",
    "drift since the calibration",
    "Calibrate shortly before the work, or take a sensor of a more stable bias.",
    "#009E73",
    sensor=True,
)
def drift(situation: Situation) -> InputErrors:
    """Change of the bias with time, and by switching the sensor off and on."""
    age = situation.setup.age
    sigma = situation.sensor.sheet.bias_change(age, restarted=True) if age > 0 else 0.0
    return _before_last(situation, sigma, sigma, sigma)


@source(
    "temperature",
    "temperature",
    "Calibrate at the temperature of the work, or estimate thermal effects (thermal_bias).",
    "#E69F00",
    hatch="////",
    sensor=True,
)
def temperature(situation: Situation) -> InputErrors:
    """Change of bias and scales, as far as the calibration does not correct it."""
    bias, scale = situation.sensor.warmed(situation.setup.temperature_change)
    return _before_last(situation, *np.hypot(bias, scale * situation.sensor_forces.T))


def _before_last(situation: Situation, *sigma: Array | float) -> InputErrors:
    """Changes of bias and scale as errors of the reading: what clips, clips them, too."""
    changes, slope = scatter(situation, (FORCE,), *sigma), situation.by_last
    return replace(changes, covariance=slope @ changes.covariance @ np.swapaxes(slope, -2, -1))


@source(
    "mounting",
    "mounting of the sensor",
    "Determine how the sensor sits on the pole by turning the pole about itself on a fixed point.",
    "#56B4E9",
)
def mounting(situation: Situation) -> InputErrors:
    """Angles between the axes of sensor and pole, constant as long as the sensor stays mounted."""
    sigma = situation.setup.mounting_sigma
    return scatter(situation, ("mounting_forward", "mounting_right"), sigma, sigma)


@source(
    "heading",
    "heading",
    "Tilt less, or get a better heading: move before the measurement, or sight it.",
    "#D55E00",
)
def heading(situation: Situation) -> InputErrors:
    """An error of the heading turns the direction of the lean; an upright pole does not lean."""
    return scatter(situation, ("yaw",), situation.setup.heading_sigma)


@source(
    "bending",
    "bending of the pole",
    "Tilt less, hold the pole higher, move the sensor towards its middle, or take a stiffer one.",
    "#7F5539",
    hatch="\\\\\\\\",
)
def bending(situation: Situation) -> InputErrors:
    """The foot is off the straight line by the flexibility times the sine of the tilt.

    The error is not corrected, and the same each time for the same tilt.
    """
    across = situation.forces[:, :2] / situation.sensor.gravity
    # The computed foot lacks the bending of the true one, which has the sign of −f.
    shift = across * flexibility(situation.setup, situation.sensor.gravity)
    return InputErrors(("bend_forward", "bend_right"), np.zeros((len(shift), 2, 2)), shift)


def flexibility(setup: Setup, g: float = STANDARD_GRAVITY) -> float:
    """Distance of the foot from the straight line through the top, for a horizontal pole, m.

    The pole is a beam of constant stiffness with small deflections (Euler and Bernoulli). It stands
    on its tip, the hand balances the weight by a force across the pole, and the top is free. Only
    the component of the weight across the pole bends it, which grows with the sine of the tilt.

    With the bending moment M(x) = P (L − x) + w (L − x)²/2 − R (h − x) of the weight P of the top,
    the weight w of a metre and the force R of the hand at h, whose last term counts below the hand
    only, and the direction of the pole measured at s, the distance is

        (∫₀ᴸ M x dx − L ∫ₛᴸ M dx) / (E I),        R = (P L + w L²/2) / h.

    With h = 0 the pole is a cantilever that is clamped at its foot. The sensor follows the slope of
    the pole where it sits. So the computed foot is this much too far away from the side to which
    the top leans; a negative distance means the other side.

    Parameters
    ----------
    setup : Setup
    g : float, m/s²
    """
    length, hand, sensor = setup.length, setup.hand_at, setup.sensor_at
    head, metre = setup.head_mass * g, setup.pole_mass * g
    free = length - sensor
    moment = head * length + metre * length**2 / 2  # at the foot, were it clamped: R h
    first = head * length**3 / 6 + metre * length**4 / 24 - moment * hand**2 / 6
    above = head * free**2 / 2 + metre * free**3 / 6
    if sensor < hand:
        above -= moment / hand * (hand - sensor) ** 2 / 2
    return (first - length * above) / setup.stiffness


@source("length", "length of the pole", "Measure the length of the pole.", "#99CC66")
def length(situation: Situation) -> InputErrors:
    """Length from the foot to the centre of the antenna or prism."""
    return scatter(situation, ("length",), situation.setup.length_sigma)


@source(
    "top",
    "position of the top",
    "Measure the top better: longer, under an open sky, or by a total station.",
    "#332288",
)
def top(situation: Situation) -> InputErrors:
    """Position of the antenna or prism, with equal errors in north and in east."""
    each, up = situation.setup.top_sigma / np.sqrt(2), situation.setup.top_sigma_vertical
    return scatter(situation, ("top_north", "top_east", "top_down"), each, each, up)
