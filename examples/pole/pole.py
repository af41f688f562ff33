"""The foot of a tilted pole: what makes it wrong, by linear theory and by Monte Carlo.

A receiver or a prism sits on a pole, a calibrated accelerometer tells how the pole leans, and
the foot is computed from both. Everything is in SI; positions are north, east, down. The axes of
the pole, and of the sensor on it, are forward, right and down along the pole.

    python pole.py calibrated/calibration.json adxl355
"""

import sys
from dataclasses import dataclass, field

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from accelstudy.basics.units import GON, MGON
from accelstudy.campaign.calibration.sensor_calibration import SensorCalibration, read_calibration
from accelstudy.data_sheets import DataSheet, get_data_sheet
from accelstudy.leveling.angles import jacobian as leveling_jacobian
from accelstudy.leveling.angles import roll_pitch

COUNTED = ("bias_instability", "acceleration_random_walk", "repeatability", "bias_per_kelvin",
           "scale_per_kelvin")  # fmt: skip
"""What a data sheet says of drift and temperature."""
DIRECTIONS = np.arange(16) * np.pi / 8
"""Directions into which the pole leans, from forward towards right."""


@dataclass(frozen=True)
class Pole:
    """A pole, its use, and how well it is known (standard deviations)."""

    length: float = 2.0
    sensor_height: float = 2.0
    hand_height: float = 1.2
    head_mass: float = 1.1
    pole_mass: float = 0.6  # of a metre
    stiffness: float = 1500.0  # E I, N m²
    averaging: float = 2.0
    age: float = 8 * 3600.0  # since the calibration; the sensor was switched off in between
    temperature_change: float = 10.0
    heading_sigma: float = 0.3 * GON
    mounting_sigma: float = 20 * MGON
    length_sigma: float = 0.5e-3
    top_sigma: float = 8e-3
    top_sigma_down: float = 15e-3


# --- geometry ------------------------------------------------------------------------------------

INPUTS = ("north", "east", "down", "roll", "pitch", "yaw", "length",
          "mounting_forward", "mounting_right", "bend_forward", "bend_right")  # fmt: skip


def foot(inputs):
    """Position of the foot, (..., 3), from the `INPUTS` (..., 11).

    The mounting angles turn the pole against the leveled axes. Bending moves the foot away from the
    straight line that leveling assumes.
    """
    x = dict(zip(INPUTS, np.moveaxis(np.asarray(inputs, float), -1, 0), strict=True))
    arm = x["bend_forward"], x["bend_right"], x["length"]
    for turn, angle in ((_forward, "mounting_forward"), (_right, "mounting_right"),
                        (_forward, "roll"), (_right, "pitch"), (_down, "yaw")):  # fmt: skip
        arm = turn(np.cos(x[angle]), np.sin(x[angle]), *arm)
    return np.stack([x["north"] + arm[0], x["east"] + arm[1], x["down"] + arm[2]], axis=-1)


def _forward(c, s, x, y, z):
    return x, c * y - s * z, s * y + c * z


def _right(c, s, x, y, z):
    return c * x + s * z, y, c * z - s * x


def _down(c, s, x, y, z):
    return c * x - s * y, s * x + c * y, z


def slope(inputs, step=1e-6):
    """Derivatives of the foot by its inputs, (k, 3, 11), by central differences."""
    steps = step * np.eye(len(INPUTS))
    each = [(foot(inputs + one) - foot(inputs - one)) / (2 * step) for one in steps]
    return np.stack(each, axis=-1)


def leaning(tilt, direction, g):
    """Specific force in the axes of a pole that leans, (..., 3)."""
    s = np.sin(tilt)
    down = s * np.cos(direction), s * np.sin(direction), np.cos(tilt) + 0 * direction
    return -g * np.stack(np.broadcast_arrays(*down), axis=-1)


@dataclass
class Situation:
    """A pole that leans by k tilts in k directions, with its calibrated sensor."""

    pole: Pole
    calibration: SensorCalibration
    sheet: DataSheet
    tilt: np.ndarray
    direction: np.ndarray
    forces: np.ndarray = field(init=False)

    def __post_init__(self):
        calibration = self.calibration
        if calibration.model.hold_columns:
            needs = ", ".join(calibration.model.hold_columns)
            raise SystemExit(f"the pole knows no {needs}; calibrate without effects of them")
        self.forces = leaning(self.tilt, self.direction, calibration.gravity)
        self.inputs = np.zeros((len(self.tilt), len(INPUTS)))
        roll, pitch = roll_pitch(tuple(self.forces.T))
        for name, value in (("roll", roll), ("pitch", pitch), ("length", self.pole.length)):
            self.inputs[:, INPUTS.index(name)] = value
        # What the sensor says, (k, 1, 3): each attitude stands alone.
        self.readings = calibration.model.sense(
            self.forces[:, None], calibration.parameters, calibration.gravity
        )

    def slope(self, names):
        """Derivatives of the foot by wrong inputs, (k, 3, m); `parameters` and `reading`, too."""
        by_inputs = slope(self.inputs)
        if names not in (("parameters",), ("reading",)):
            return by_inputs[..., [INPUTS.index(name) for name in names]]
        angles = by_inputs[..., [INPUTS.index("roll"), INPUTS.index("pitch")]]
        model, at = self.calibration.model, (self.calibration.parameters, self.calibration.gravity)
        of_model = model.correction_jacobian if names == ("parameters",) else model.output_jacobian
        return angles @ leveling_jacobian(self.forces) @ of_model(self.readings, *at)[:, 0]

    def errors(self, wrong):
        """Errors of the foot, (R, k, 3), from wrong inputs {names: (R, k, m)}, without derivatives.

        The sensor's reading is corrected by wrong parameters, leveled, and put into the geometry.
        """
        model, calibration = self.calibration.model, self.calibration
        readings = self.readings + wrong.get(("reading",), np.zeros(3))[..., None, :]
        parameters = calibration.parameters + wrong.get(("parameters",), 0.0)
        forces = model.correct(readings, parameters, calibration.gravity)[..., 0, :]
        count = max(len(values) for values in wrong.values())
        inputs = np.broadcast_to(self.inputs, (count, *self.inputs.shape)).copy()
        inputs[..., [INPUTS.index("roll"), INPUTS.index("pitch")]] = np.stack(
            roll_pitch(tuple(np.moveaxis(forces, -1, 0))), axis=-1
        )
        for names, values in wrong.items():
            if names not in (("parameters",), ("reading",)):
                inputs[..., [INPUTS.index(name) for name in names]] += values
        return foot(inputs) - foot(self.inputs)


# --- sources of error ----------------------------------------------------------------------------

SOURCES = {}
"""Name of each source, and a function of a situation that returns what it makes wrong: the names of
the inputs, the covariance of their errors (k, m, m), and the mean of these (k, m)."""


def source(function):
    SOURCES[function.__name__.replace("_", " ")] = function
    return function


def scatter(situation, names, *sigma):
    """Independent errors of inputs."""
    sigma = np.stack(np.broadcast_arrays(*sigma, situation.tilt)[:-1], axis=-1)
    return names, sigma[..., None] ** 2 * np.eye(len(names) if len(names) > 1 else 3), 0 * sigma


# --8<-- [start:calibration]
@source
def calibration(situation):
    """Errors of the parameters, with their correlations."""
    covariance = situation.calibration.covariance
    k, u = len(situation.tilt), len(covariance)
    return ("parameters",), np.broadcast_to(covariance, (k, u, u)), np.zeros((k, u))


# --8<-- [end:calibration]


@source
def noise(situation):
    """Noise of the mean of a reading."""
    sigma = situation.sheet.sigma_mean(situation.pole.averaging)
    return scatter(situation, ("reading",), sigma, sigma, sigma)


@source
def drift(situation):
    """Change of the bias with time, and by switching off and on."""
    age = situation.pole.age
    sigma = situation.sheet.bias_change(age, restarted=True) if age else 0.0
    return _before_clipping(situation, sigma, sigma, sigma)


@source
def temperature(situation):
    """Change of bias and scales with temperature."""
    bias, scale = situation.sheet.temperature_sigmas(situation.pole.temperature_change)
    return _before_clipping(situation, *np.hypot(bias, scale * situation.forces.T))


def _before_clipping(situation, *sigma):
    """Changes of bias and scale as errors of the reading: a sensor that clips, clips them, too."""
    names, covariance, mean = scatter(situation, ("reading",), *sigma)
    model, parameters = situation.calibration.model, situation.calibration.parameters
    f_a = model.sensitive_force(situation.readings, parameters, situation.calibration.gravity)
    slope = model.slope_of_last(f_a, parameters, None)[:, 0]
    return names, slope @ covariance @ np.swapaxes(slope, -2, -1), mean


@source
def mounting(situation):
    """Angles between the axes of sensor and pole."""
    sigma = situation.pole.mounting_sigma
    return scatter(situation, ("mounting_forward", "mounting_right"), sigma, sigma)


@source
def heading(situation):
    """A wrong heading turns the lean about the vertical."""
    names, variance, mean = ("yaw",), situation.pole.heading_sigma**2, np.zeros(1)
    k = len(situation.tilt)
    return names, np.full((k, 1, 1), variance), np.broadcast_to(mean, (k, 1))


@source
def bending(situation):
    """The foot is off the straight line, the same each time for the same tilt."""
    across = situation.forces[:, :2] / situation.calibration.gravity
    shift = across * flexibility(situation.pole, situation.calibration.gravity)
    return ("bend_forward", "bend_right"), np.zeros((len(shift), 2, 2)), shift


def flexibility(pole, g):
    """Distance of the foot of a horizontal pole from the line that its sensor assumes, m.

    An Euler–Bernoulli beam: the pole stands on its tip, the hand balances the weight by a force
    across it, the top is free. M(x) = P (L − x) + w (L − x)²/2 − R (h − x), the last below the hand
    only, with R = (P L + w L²/2) / h; the distance is (∫₀ᴸ M x dx − L ∫ₛᴸ M dx) / (E I).
    """
    length, hand, at = pole.length, pole.hand_height, pole.sensor_height
    head, metre, free = pole.head_mass * g, pole.pole_mass * g, pole.length - pole.sensor_height
    moment = head * length + metre * length**2 / 2
    first = head * length**3 / 6 + metre * length**4 / 24 - moment * hand**2 / 6
    above = head * free**2 / 2 + metre * free**3 / 6
    if at < hand:
        above -= moment / hand * (hand - at) ** 2 / 2
    return (first - length * above) / pole.stiffness


@source
def length(situation):
    """Length of the pole."""
    k = len(situation.tilt)
    return ("length",), np.full((k, 1, 1), situation.pole.length_sigma**2), np.zeros((k, 1))


@source
def position_of_the_top(situation):
    """Position of the receiver or prism; north and east have equal parts of its error."""
    pole = situation.pole
    each = pole.top_sigma / np.sqrt(2)
    return scatter(situation, ("north", "east", "down"), each, each, pole.top_sigma_down)


# --- budget and Monte Carlo ----------------------------------------------------------------------


def situation_at(pole, calibration, sheet, tilt):
    """A pole that leans by a tilt into all directions."""
    tilts = np.full(len(DIRECTIONS), tilt)
    return Situation(pole, calibration, sheet, tilts, DIRECTIONS)


def mean_squares(situation):
    """Mean squares of the errors of the foot, {source: (k, 3)}, by linear theory."""
    squares = {}
    for name, errors in SOURCES.items():
        inputs, covariance, mean = errors(situation)
        by_inputs = situation.slope(inputs)
        shift = np.einsum("kim,km->ki", by_inputs, mean)
        spread = by_inputs @ covariance @ np.swapaxes(by_inputs, -2, -1)
        squares[name] = np.diagonal(spread, axis1=-2, axis2=-1) + shift**2
    return squares


def budget(pole, calibration, sheet, tilts):
    """Rms errors by source, over all directions: a table of tilt, horizontal and down, m."""
    rows = []
    for tilt in tilts:
        squares = mean_squares(situation_at(pole, calibration, sheet, tilt))
        for name, each in {**squares, "all together": sum(squares.values())}.items():
            rms = np.sqrt(each[:, :2].sum(axis=1).mean()), np.sqrt(each[:, 2].mean())
            rows.append((tilt / GON, name, *rms))
    return pd.DataFrame(rows, columns=["tilt_gon", "source", "horizontal", "down"])


def simulate(pole, calibration, sheet, tilt, replicates, seed):
    """Errors of the foot, (R, k, 3), with errors from every source at once."""
    situation, rng = situation_at(pole, calibration, sheet, tilt), np.random.default_rng(seed)
    wrong = {}
    for errors in SOURCES.values():
        names, covariance, mean = errors(situation)
        variance, axes = np.linalg.eigh(covariance)  # a covariance may be singular
        normal = rng.standard_normal((replicates, *mean.shape)) * np.sqrt(np.maximum(variance, 0))
        drawn = mean + np.einsum("kij,rkj->rki", axes, normal)
        wrong[names] = wrong.get(names, 0.0) + drawn
    return situation.errors(wrong)


def draw(table, simulated, path):
    """Draw what each source contributes horizontally over the tilt, and the Monte Carlo."""
    figure, ax = plt.subplots(figsize=(6.3, 4.2), layout="constrained")
    marks = dict(zip(SOURCES, ("o", "s", "^", "v", "D", "P", "X", "<", ">"), strict=True))
    for name, rows in table.groupby("source", sort=False):
        total = name not in marks
        ax.plot(
            rows["tilt_gon"], 1e3 * rows["horizontal"], label=name, markevery=5, markersize=4,
            marker=marks.get(name), color="black" if total else None, linewidth=2 if total else 1.2,
        )  # fmt: skip
    ax.plot(
        simulated.index, 1e3 * simulated, "o", color="black", markerfacecolor="white",
        label="Monte Carlo",
    )  # fmt: skip
    ax.set(xlabel="tilt / gon", ylabel="horizontal error of the foot, rms / mm", yscale="log",
           ylim=(0.01, None))  # fmt: skip
    ax.grid(alpha=0.3)
    figure.legend(loc="outside lower center", ncols=3, frameon=False)
    figure.savefig(path, dpi=150)


def main(path, name):
    """Print the budget of a pole at three tilts, and draw it."""
    pole, calibrated, sheet = Pole(), read_calibration(path), get_data_sheet(name)
    tilts = np.array([10, 30, 50]) * GON
    table = budget(pole, calibrated, sheet, tilts)
    drawn = [simulate(pole, calibrated, sheet, tilt, 2000, seed) for seed, tilt in enumerate(tilts)]
    print(f"{'rms / mm':20s}{'horizontal':>24s}{'down':>24s}")
    print(f"{'tilt / gon':20s}" + "".join(f"{tilt / GON:8.0f}" for tilt in [*tilts, *tilts]))
    for source, rows in table.groupby("source", sort=False):
        cells = [*rows["horizontal"], *rows["down"]]
        print(f"{source:20s}" + "".join(f"{1e3 * cell:8.2f}" for cell in cells))
    rms = [np.sqrt(np.mean(np.sum(errors[..., :2] ** 2, axis=-1))) for errors in drawn]
    within = [np.quantile(np.hypot(errors[..., 0], errors[..., 1]), 0.95) for errors in drawn]
    for source, cells in (("Monte Carlo", rms), ("95 of 100 within", within)):
        print(f"{source:20s}" + "".join(f"{1e3 * cell:8.1f}" for cell in cells))
    unknown = ", ".join(name for name in sheet.unknown_quantities if name in COUNTED)
    print(f"Not in the data sheet {sheet.name}, and not counted: {unknown or 'nothing'}")
    curves = budget(pole, calibrated, sheet, np.linspace(0, 50, 51) * GON)
    draw(curves, pd.Series(rms, index=tilts / GON), "pole.png")


if __name__ == "__main__":
    main(*sys.argv[1:])
