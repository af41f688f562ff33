"""Whether sessions keep a promise that choose their positions and stop when it seems kept.

Each session has a sensor of its own. The noise is known; or it is unknown, and an upper confidence
bound of it is taken from the residuals, or what the residuals seem to say. The promise is a
multiple of the tilt accuracy that a fixed scheme has.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator
from numpy.typing import ArrayLike, NDArray

from accelstudy.adjustment import Observations
from accelstudy.approaches import Approach, get_approach
from accelstudy.basics.progress import track
from accelstudy.basics.shares import clopper_pearson, sigmas_95
from accelstudy.basics.units import (
    GON,
    STANDARD_GRAVITY,
    attitude_unit,
    display_unit,
    to_attitude,
    to_display,
)
from accelstudy.design.estimability import estimability
from accelstudy.design.task import position_rows
from accelstudy.drawing.style import FULL, INK, MM, STYLE, approach_colour, approach_marker
from accelstudy.leveling.angles import angles_of
from accelstudy.leveling.error import TiltError, tilt_error
from accelstudy.schemes import get_scheme
from accelstudy.sensors.models import NINE, get_model
from accelstudy.sequential.choice import DEFAULTS, Chooser, candidates, typical_sizes
from accelstudy.sequential.estimate import Estimate, estimate
from accelstudy.sequential.promise import Promise, bound, known, rms_of
from accelstudy.simulation.sessions import Noise

Array = NDArray[np.float64]

MODEL = get_model(NINE)
"""Of the sensor and of the calibration."""
FIXED = get_scheme("mclaren-24")
TILT_RANGE = 30 * GON
NOISE = Noise()
PLACING = 2 * GON
"""Sd per axis by which positions miss the chosen attitudes."""
SECONDS = 60.0
"""Time for a position, the turn to it included."""
MOST_POSITIONS = 120
SEED = 1
AT_ONCE = 500
"""Sessions that are simulated together; more would only take memory."""
ROUNDING = 1e-9
"""Relative excess over the promise that is rounding."""
CENTRAL = (0.05, 0.5, 0.95)
"""Quantiles of the numbers of positions."""


def plain(omega: ArrayLike, redundancy: int) -> Array:
    """Variance of unit weight as the residuals seem to say, Ω/r."""
    if redundancy < 1:
        return np.full(np.shape(omega), np.inf)
    return np.asarray(omega) / redundancy


RULES = {"known": known, "bound": bound, "plain": plain}
"""What the variance of unit weight is taken for."""


@dataclass(frozen=True)
class Setting:
    """Sessions of one kind.

    Attributes
    ----------
    approach : str
    rule : str, of `RULES`
    multiple : float, promised accuracy over that of the fixed scheme
    sessions : int
    most_positions : int, with which a session ends in any case
    """

    approach: str
    rule: str
    multiple: float = 1.0
    sessions: int = 1000
    most_positions: int = MOST_POSITIONS

    @cached_property
    def equipment(self) -> Approach:
        """The approach."""
        return get_approach(self.approach)

    @cached_property
    def promise(self) -> Promise:
        """Promised accuracy: a multiple of that of the fixed scheme, by linear theory."""
        cofactors = estimability(FIXED, MODEL, self.equipment, NOISE).cofactors
        error = Promise(np.inf, TILT_RANGE).tilt_error(MODEL)
        return Promise(self.multiple * float(error.rms_of_all(cofactors).max()), TILT_RANGE)

    @cached_property
    def chooser(self) -> Chooser:
        """The chooser of the positions."""
        directions = candidates(DEFAULTS[self.approach])
        return Chooser(
            directions,
            position_rows(MODEL, self.equipment, NOISE, directions),
            self.promise.tilt_error(MODEL),
            self.promise,
            RULES[self.rule],
            typical_sizes(MODEL, MODEL.n_parameters),
        )

    @cached_property
    def attitudes(self) -> list[TiltError]:
        """Attitudes in which intervals are checked: level, and tilted by the tilt range."""
        sin, cos = np.sin(TILT_RANGE), np.cos(TILT_RANGE)
        down = [(0, 0, 1), (sin, 0, cos), (-sin, 0, cos), (0, sin, cos), (0, -sin, cos)]
        ideal = np.zeros(MODEL.n_parameters)
        return [
            tilt_error(MODEL, ideal, MODEL, ideal, -STANDARD_GRAVITY * np.array([d])) for d in down
        ]

    @property
    def labels(self) -> dict[str, Any]:
        """Columns that identify the setting of a row."""
        return {
            "approach": self.approach,
            "rule": self.rule,
            "multiple": self.multiple,
            "promised": self.promise.accuracy,
        }

    def rng(self, seed: int, part: int) -> np.random.Generator:
        """Random numbers of a part of the sessions; all rules share them, to be compared."""
        name = f"{MODEL.name} {self.approach} {self.multiple}"
        digest = int.from_bytes(hashlib.sha256(name.encode()).digest()[:8], "big")
        return np.random.default_rng(np.random.SeedSequence([seed, digest], spawn_key=(part,)))


SETTINGS = [Setting(*each) for each in product(("gravity", "robot"), RULES, (0.75, 1.0, 1.5, 2.0))]


def sessions_table(settings: Sequence[Setting], seed: int = SEED) -> pd.DataFrame:
    """All sessions, one row each: the columns of `simulate`, and its setting."""
    return pd.concat(
        [simulate(each, seed).assign(**each.labels) for each in track(settings, "sessions")],
        ignore_index=True,
    )


def summary_table(sessions: pd.DataFrame) -> pd.DataFrame:
    """One row for each setting, with the columns of `summarise`."""
    labels = ["approach", "rule", "multiple", "promised"]
    groups = sessions.groupby(labels, sort=False)
    return pd.DataFrame(
        [dict(zip(labels, key, strict=True)) | summarise(part) for key, part in groups]
    )


def simulate(setting: Setting, seed: int) -> pd.DataFrame:
    """Simulate all sessions of a setting.

    Returns
    -------
    DataFrame
        A row for each session, angles in rad: the number of positions; the rms of roll and pitch
        that it claims, the one by the true noise, and the actual error of its calibration; the
        shares of intervals that contain the truth.
    """
    sizes = [AT_ONCE] * (setting.sessions // AT_ONCE)
    sizes += [rest] if (rest := setting.sessions % AT_ONCE) else []
    parts = [_simulate(setting, size, setting.rng(seed, i)) for i, size in enumerate(sizes)]
    return pd.concat(parts, ignore_index=True)


def _simulate(setting: Setting, sessions: int, rng: np.random.Generator) -> pd.DataFrame:
    chooser = setting.chooser
    truth = _sensors(sessions, rng)
    nothing = np.zeros((sessions, 0, 3)), np.zeros((sessions, 0, 2))
    going, (forces, angles) = np.arange(sessions), nothing
    so_far = estimate(MODEL, setting.equipment, _observed(forces, angles))
    rms, last = np.full((sessions, 2), np.inf), None
    ended: list[pd.DataFrame] = []
    for n in range(1, setting.most_positions + 1):
        chosen = chooser.choose(so_far.information, so_far.solved, rms, last)
        # Drawn for all sessions, so that none depends on which others have ended.
        off = PLACING * rng.standard_normal((sessions, 3))
        errors = rng.standard_normal((sessions, 3)), rng.standard_normal((sessions, 2))
        last = chooser.directions[chosen] + off[going]
        last /= np.linalg.norm(last, axis=1, keepdims=True)
        read = _measure(truth[going], last, *(error[going] for error in errors))
        forces, angles = (
            np.concatenate([before, new], axis=1)
            for before, new in zip((forces, angles), read, strict=True)
        )
        observed = _observed(forces, angles)
        so_far = estimate(MODEL, setting.equipment, observed, before=so_far)

        rms = np.full((len(going), 2), np.inf)
        ok = so_far.solved
        rms[ok] = chooser.rms(so_far.cofactors[ok], so_far.omega[ok], so_far.redundancy)
        done = setting.promise.reached(rms)
        if done.any() or n == setting.most_positions:
            over = done | (n == setting.most_positions)
            row = _outcome(setting, so_far.sessions(np.flatnonzero(over)), truth[going[over]])
            row.insert(0, "session", going[over])
            row["kept"] = done[over]
            row[["claimed_roll", "claimed_pitch"]] = rms[over]
            ended.append(row)
            left = np.flatnonzero(~over)
            if not len(left):
                break
            so_far, going = so_far.sessions(left), going[left]
            forces, angles, rms, last = forces[left], angles[left], rms[left], last[left]
    return pd.concat(ended).sort_values("session", ignore_index=True).drop(columns="session")


def _sensors(count: int, rng: np.random.Generator) -> Array:
    """Parameters of sensors, (R, u), anywhere between typical sizes, of either sign."""
    low, high = np.log([e.typical for e in MODEL.effects for _ in e.parameters]).T
    sizes = np.exp(rng.uniform(low, high, (count, len(low))))
    return np.asarray(sizes * rng.choice([-1.0, 1.0], sizes.shape))


def _measure(
    truth: Array, directions: Array, noise: Array, angle_noise: Array
) -> tuple[Array, Array]:
    """Readings of one position each, forces (R, 1, 3) and the robot's angles (R, 1, 2)."""
    f_b = -STANDARD_GRAVITY * directions[:, None]
    force = MODEL.sense(f_b, truth) + NOISE.sigma_force * noise[:, None]
    angles = angles_of(f_b)
    angles = angles + MODEL.reading_errors(angles, truth)
    return force, angles + NOISE.sigma_angle * angle_noise[:, None]


def _observed(forces: Array, angles: Array) -> Observations:
    return Observations(forces, NOISE.sigma_force, angles, NOISE.sigma_angle, STANDARD_GRAVITY)


def _outcome(setting: Setting, so_far: Estimate, truth: Array) -> pd.DataFrame:
    """Results of sessions that have ended, one row each."""
    error, cofactors = setting.chooser.error, so_far.cofactors
    delta = so_far.parameters - truth
    true_rms, actual = rms_of(error, cofactors), error.rms(delta)
    r = so_far.redundancy
    if setting.rule == "known":
        width = np.full(len(truth), sigmas_95())
    else:
        sigma0 = np.sqrt(so_far.omega / r) if r > 0 else np.full(len(truth), np.nan)
        width = sigmas_95(r) * sigma0
    sigma = np.sqrt(np.diagonal(cofactors, axis1=1, axis2=2))
    inside = np.abs(delta) <= width[:, None] * sigma
    angles = np.stack([each.rms(delta) for each in setting.attitudes], axis=1)
    spread = np.stack([rms_of(each, cofactors) for each in setting.attitudes], axis=1)
    return pd.DataFrame(
        {
            "positions": so_far.n_positions,
            "redundancy": r,
            "omega": so_far.omega,
            "true_roll": true_rms[:, 0],
            "true_pitch": true_rms[:, 1],
            "actual_roll": actual[:, 0],
            "actual_pitch": actual[:, 1],
            "parameters_inside": inside.mean(axis=1),
            "angles_inside": np.mean(angles <= width[:, None, None] * spread, axis=(1, 2)),
        }
    )


def summarise(sessions: pd.DataFrame) -> dict[str, Any]:
    """What the sessions of one setting come to: angles in rad, times in s, intervals of 95 %.

    `broken` is the share of sessions that stopped although, by the true noise, roll or pitch was
    not yet as accurate as promised. `rms` is over all sessions and attitudes, relative to the
    promise.
    """
    n, promised = len(sessions), sessions["promised"].iloc[0]
    positions = sessions["positions"].to_numpy(dtype=float)
    true = sessions[["true_roll", "true_pitch"]].to_numpy().max(axis=1)
    broken = int(np.count_nonzero(sessions["kept"] & (true > promised * (1 + ROUNDING))))
    low, high = clopper_pearson(broken, n)
    # A posteriori at the end; to stop by it makes it too small.
    variance = sessions["omega"] / sessions["redundancy"].where(sessions["redundancy"] > 0)
    actual = (sessions[["actual_roll", "actual_pitch"]].to_numpy() / promised) ** 2
    # How often the fixed scheme must be measured in full for the same accuracy.
    rounds = int(np.ceil(round(sessions["multiple"].iloc[0] ** -2, 9)))
    fixed = rounds * FIXED.n_positions
    row: dict[str, Any] = {
        "sessions": n,
        "kept": float(sessions["kept"].mean()),
        "positions": positions.mean(),
        **{f"positions_{int(100 * q)}": float(np.quantile(positions, q)) for q in CENTRAL},
        "fixed_positions": fixed,
        "saved_positions": fixed - positions.mean(),
        "saved_seconds": SECONDS * (fixed - positions.mean()),
        "broken": broken / n,
        "broken_low": float(low),
        "broken_high": float(high),
        "variance": float(np.mean(variance)),
    }
    for i, angle in enumerate(("roll", "pitch")):
        mean, half = _mean(actual[:, i])
        row[f"rms_{angle}"] = np.sqrt(mean)
        row[f"rms_{angle}_low"] = np.sqrt(max(mean - half, 0.0))
        row[f"rms_{angle}_high"] = np.sqrt(mean + half)
    for what in ("parameters", "angles"):
        mean, half = _mean(sessions[f"{what}_inside"].to_numpy())
        row |= {f"{what}_inside": mean, f"{what}_inside_low": mean - half}
        row[f"{what}_inside_high"] = mean + half
    return row


def _mean(values: np.ndarray[Any, np.dtype[np.float64]]) -> tuple[float, float]:
    """Mean, and half the width of its interval."""
    half = sigmas_95(len(values) - 1) * np.std(values, ddof=1) / np.sqrt(len(values))
    return float(np.mean(values)), float(half)


NAMES = {
    "known": "noise known",
    "bound": "upper bound from residuals",
    "plain": "as the residuals seem",
}
LINES: dict[str, Any] = {"known": "-", "bound": "--", "plain": ":"}


def stopping_figure(summary: pd.DataFrame) -> Figure:
    """Positions that a promise takes, and how often it is broken; of `summary_table`."""
    with mpl.rc_context(STYLE):  # type: ignore[arg-type]
        figure = Figure(figsize=(FULL, 92 * MM), layout="constrained")
        left, right = figure.subplots(1, 2)
        for (approach, rule), part in summary.groupby(["approach", "rule"], sort=False):
            ordered = part.sort_values("promised")
            _positions(left, str(approach), str(rule), ordered)
            _broken(right, str(approach), str(rule), ordered)
        for approach, part in summary.groupby("approach", sort=False):
            accuracy = (part["promised"] / part["multiple"]).iloc[0]
            left.plot(
                to_display(accuracy, "rad"), FIXED.n_positions, "*", markersize=11,
                color=approach_colour(str(approach)), markeredgecolor="white", zorder=5,
            )  # fmt: skip
        tilt = f"{float(to_attitude(TILT_RANGE)):.0f} {attitude_unit()}"
        for axes in (left, right):
            axes.set_xscale("log")
            axes.set_xlabel(f"promised rms up to {tilt} of tilt [{display_unit('rad')}]")
            axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 3, 5)))
            axes.xaxis.set_major_formatter("{x:g}")
            axes.minorticks_off()
        left.set_ylabel("positions")
        left.set_title("until the promise seems kept: mean, central 90 %", loc="left")
        left.set_ylim(bottom=0)
        right.set_ylabel("sessions [%]")
        right.set_title("less accurate than promised", loc="left")
        right.set_ylim(-2, 102)
        right.axhline(5, color=INK, linewidth=0.6)
        right.annotate("5 %", (1, 5), xycoords=("axes fraction", "data"), fontsize=7,
                       xytext=(-2, 2), textcoords="offset points", ha="right")  # fmt: skip
        handles = [
            Line2D([], [], color=approach_colour(a), marker=approach_marker(a), label=a)
            for a in summary["approach"].unique()
        ]
        handles += [
            Line2D([], [], color=INK, linestyle=LINES[r], label=NAMES[r])
            for r in summary["rule"].unique()
        ]
        handles.append(
            Line2D(
                [],
                [],
                color=INK,
                marker="*",
                markersize=9,
                linestyle="",
                label=f"fixed: {FIXED.name}",
            )
        )
        figure.legend(handles=handles, loc="outside upper center", ncols=3)
    return figure


def _positions(axes: Axes, approach: str, rule: str, part: pd.DataFrame) -> None:
    colour, x = approach_colour(approach), to_display(part["promised"], "rad")
    axes.plot(x, part["positions"], LINES[rule], color=colour, marker=approach_marker(approach))
    if rule != "plain":
        low, high = part["positions_5"], part["positions_95"]
        axes.fill_between(x, low, high, color=colour, alpha=0.12, linewidth=0)


def _broken(axes: Axes, approach: str, rule: str, part: pd.DataFrame) -> None:
    x, share = to_display(part["promised"], "rad"), 100 * part["broken"].to_numpy()
    ends = 100 * part[["broken_low", "broken_high"]].to_numpy().T
    axes.errorbar(
        x, share, yerr=np.abs(ends - share), color=approach_colour(approach), capsize=2,
        marker=approach_marker(approach), linestyle=LINES[rule],
    )  # fmt: skip
