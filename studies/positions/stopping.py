"""Whether sessions keep a promise that choose their positions and stop when it seems kept.

Each session has a sensor of its own. The noise is known; or it is unknown, and an upper confidence
bound of it is taken from the residuals, or what the residuals seem to say. The promise is a
multiple of the tilt accuracy that a fixed scheme has.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator
from numpy.typing import ArrayLike, NDArray

from accelstudy.adjustment import Observations
from accelstudy.approaches import get_approach
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
from accelstudy.drawing.style import FULL, INK, STYLE, approach_colour, approach_marker, new_figure
from accelstudy.leveling.angles import angles_of
from accelstudy.leveling.error import tilt_error
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
    def promise(self) -> Promise:
        """Promised accuracy: a multiple of that of the fixed scheme, by linear theory."""
        cofactors = estimability(FIXED, MODEL, get_approach(self.approach), NOISE).cofactors
        error = Promise(np.inf, TILT_RANGE).tilt_error(MODEL)
        return Promise(self.multiple * float(error.rms_of_all(cofactors).max()), TILT_RANGE)

    @cached_property
    def chooser(self) -> Chooser:
        """The chooser of the positions."""
        directions = candidates(DEFAULTS[self.approach])
        return Chooser(
            directions,
            position_rows(MODEL, get_approach(self.approach), NOISE, directions),
            self.promise.tilt_error(MODEL),
            self.promise,
            RULES[self.rule],
            typical_sizes(MODEL, MODEL.n_parameters),
        )

    def rng(self, seed: int, part: int) -> np.random.Generator:
        """Random numbers of a part of the sessions; all rules share them, to be compared."""
        name = f"{MODEL.name} {self.approach} {self.multiple}"
        digest = int.from_bytes(hashlib.sha256(name.encode()).digest()[:8], "big")
        return np.random.default_rng(np.random.SeedSequence([seed, digest], spawn_key=(part,)))


LABELS = ["approach", "rule", "multiple", "promised"]
"""Columns that identify the setting of a session."""
SETTINGS = [Setting(*each) for each in product(("gravity", "robot"), RULES, (0.75, 1.0, 1.5, 2.0))]


def simulate(setting: Setting, seed: int) -> pd.DataFrame:
    """Simulate all sessions of a setting.

    Returns
    -------
    DataFrame
        A row for each session, angles in rad: the number of positions; the rms of roll and pitch
        that it claims, the one by the true noise, and the actual error of its calibration; the
        shares of intervals that contain the truth.
    """
    starts = range(0, setting.sessions, AT_ONCE)
    sizes = [min(AT_ONCE, setting.sessions - start) for start in starts]
    parts = [_simulate(setting, size, setting.rng(seed, i)) for i, size in enumerate(sizes)]
    labels = {name: getattr(setting, name) for name in LABELS[:-1]}
    return pd.concat(parts, ignore_index=True).assign(**labels, promised=setting.promise.accuracy)


def _simulate(setting: Setting, sessions: int, rng: np.random.Generator) -> pd.DataFrame:
    chooser, approach = setting.chooser, get_approach(setting.approach)
    truth, going = _sensors(sessions, rng), np.arange(sessions)
    forces, angles = np.zeros((sessions, 0, 3)), np.zeros((sessions, 0, 2))
    so_far = estimate(MODEL, approach, _observed(forces, angles))
    rms, last = np.full((sessions, 2), np.inf), None
    ended: list[pd.DataFrame] = []
    for n in range(1, setting.most_positions + 1):
        chosen = chooser.choose(so_far.information, so_far.solved, rms, last)
        # Drawn for all sessions, so that none depends on which others have ended.
        off = PLACING * rng.standard_normal((sessions, 3))
        errors = rng.standard_normal((sessions, 3)), rng.standard_normal((sessions, 2))
        last = chooser.directions[chosen] + off[going]
        last /= np.linalg.norm(last, axis=1, keepdims=True)
        f_b = -STANDARD_GRAVITY * last[:, None]
        force = MODEL.sense(f_b, truth[going]) + NOISE.sigma_force * errors[0][going, None]
        angle = angles_of(f_b)
        angle = angle + MODEL.reading_errors(angle, truth[going])
        angle = angle + NOISE.sigma_angle * errors[1][going, None]
        forces = np.concatenate([forces, force], axis=1)
        angles = np.concatenate([angles, angle], axis=1)
        so_far = estimate(MODEL, approach, _observed(forces, angles), before=so_far)

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


def _observed(forces: Array, angles: Array) -> Observations:
    return Observations(forces, NOISE.sigma_force, angles, NOISE.sigma_angle, STANDARD_GRAVITY)


def _outcome(setting: Setting, so_far: Estimate, truth: Array) -> pd.DataFrame:
    """Results of sessions that have ended, one row each."""
    error, cofactors, r = setting.chooser.error, so_far.cofactors, so_far.redundancy
    delta = so_far.parameters - truth
    if setting.rule == "known":
        width = np.full(len(truth), sigmas_95())
    else:
        sigma0 = np.sqrt(so_far.omega / r) if r > 0 else np.full(len(truth), np.nan)
        width = sigmas_95(r) * sigma0
    inside = np.abs(delta) <= width[:, None] * np.sqrt(np.diagonal(cofactors, axis1=1, axis2=2))
    # Intervals of angles are checked level, and tilted by the tilt range.
    sin, cos, ideal = np.sin(TILT_RANGE), np.cos(TILT_RANGE), np.zeros(MODEL.n_parameters)
    down = [(0, 0, 1), (sin, 0, cos), (-sin, 0, cos), (0, sin, cos), (0, -sin, cos)]
    at = [tilt_error(MODEL, ideal, MODEL, ideal, -STANDARD_GRAVITY * np.array([d])) for d in down]
    angles = np.stack([each.rms(delta) for each in at], axis=1)
    spread = np.stack([rms_of(each, cofactors) for each in at], axis=1)
    both = {"true": rms_of(error, cofactors), "actual": error.rms(delta)}
    return pd.DataFrame(
        {
            "positions": so_far.n_positions,
            "redundancy": r,
            "omega": so_far.omega,
            **{f"{name}_{angle}": rms[:, i] for name, rms in both.items()
               for i, angle in enumerate(("roll", "pitch"))},
            "parameters_inside": inside.mean(axis=1),
            "angles_inside": np.mean(angles <= width[:, None, None] * spread, axis=(1, 2)),
        }
    )  # fmt: skip


def summary_table(sessions: pd.DataFrame) -> pd.DataFrame:
    """What the sessions of each setting come to, a row each: angles in rad, intervals of 95 %.

    `broken` is the share of sessions that stopped although, by the true noise, roll or pitch was
    not yet as accurate as promised. `rms` is over all sessions and attitudes, relative to the
    promise.
    """
    true, promised = sessions[["true_roll", "true_pitch"]].max(axis=1), sessions["promised"]
    squares = {f"rms_{angle}": (sessions[f"actual_{angle}"] / promised) ** 2
               for angle in ("roll", "pitch")}  # fmt: skip
    groups = sessions.assign(
        sessions=1,
        broken=sessions["kept"] & (true > promised * (1 + ROUNDING)),
        # A posteriori at the end; to stop by it makes it too small.
        variance=sessions["omega"] / sessions["redundancy"].where(sessions["redundancy"] > 0),
        **squares,
    ).groupby(LABELS, sort=False)
    means = ["kept", "positions", "broken", "variance", "parameters_inside", "angles_inside"]
    table = groups[[*means, *squares]].mean().join(groups["sessions"].sum())
    table[[*squares]] **= 0.5
    for share in CENTRAL:
        table[f"positions_{int(100 * share)}"] = groups["positions"].quantile(share)
    ends = clopper_pearson(groups["broken"].sum(), table["sessions"])
    table["broken_low"], table["broken_high"] = ends
    table = table.reset_index()
    # How often the fixed scheme must be measured in full for the same accuracy.
    rounds = np.ceil((table["multiple"] ** -2).round(9))
    return table.assign(fixed_positions=rounds * FIXED.n_positions)


NAMES = {
    "known": "noise known",
    "bound": "upper bound from residuals",
    "plain": "as the residuals seem",
}
LINES: dict[str, Any] = {"known": "-", "bound": "--", "plain": ":"}


def stopping_figure(summary: pd.DataFrame) -> Figure:
    """Positions that a promise takes, and how often it is broken; of `summary_table`."""
    with mpl.rc_context(STYLE):  # type: ignore[arg-type]
        figure = new_figure(FULL, 92)
        left, right = figure.subplots(1, 2)
        handles = []
        for (approach, rule), rows in summary.groupby(["approach", "rule"], sort=False):
            part, colour = rows.sort_values("promised"), approach_colour(str(approach))
            look: Any = {"color": colour, "marker": approach_marker(str(approach)),
                         "linestyle": LINES[str(rule)]}  # fmt: skip
            x, share = to_display(part["promised"], "rad"), 100 * part["broken"].to_numpy()
            left.plot(x, part["positions"], **look)
            if rule != "plain":
                low, high = part["positions_5"], part["positions_95"]
                left.fill_between(x, low, high, color=colour, alpha=0.12, linewidth=0)
            ends = 100 * part[["broken_low", "broken_high"]].to_numpy().T
            right.errorbar(x, share, yerr=np.abs(ends - share), capsize=2, **look)
        for approach, part in summary.groupby("approach", sort=False):
            colour = approach_colour(str(approach))
            accuracy = to_display((part["promised"] / part["multiple"]).iloc[0], "rad")
            left.plot(accuracy, FIXED.n_positions, "*", markersize=11, color=colour,
                      markeredgecolor="white", zorder=5)  # fmt: skip
            marker = approach_marker(str(approach))
            handles.append(Line2D([], [], color=colour, marker=marker, label=approach))
        tilt = f"{float(to_attitude(TILT_RANGE)):.0f} {attitude_unit()}"
        for axes in (left, right):
            axes.set(
                xscale="log", xlabel=f"promised rms up to {tilt} of tilt [{display_unit('rad')}]"
            )
            axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 3, 5)))
            axes.xaxis.set_major_formatter("{x:g}")
            axes.minorticks_off()
        left.set(ylabel="positions", ylim=(0, None))
        left.set_title("until the promise seems kept: mean, central 90 %", loc="left")
        right.set(ylabel="sessions [%]", ylim=(-2, 102))
        right.set_title("less accurate than promised", loc="left")
        right.axhline(5, color=INK, linewidth=0.6)
        right.annotate("5 %", (1, 5), xycoords=("axes fraction", "data"), fontsize=7,
                       xytext=(-2, 2), textcoords="offset points", ha="right")  # fmt: skip
        handles += [Line2D([], [], color=INK, linestyle=LINES[rule], label=NAMES[rule])
                    for rule in summary["rule"].unique()]  # fmt: skip
        handles.append(Line2D([], [], color=INK, marker="*", markersize=9, linestyle="",
                              label=f"fixed: {FIXED.name}"))  # fmt: skip
        figure.legend(handles=handles, loc="outside upper center", ncols=3)
    return figure
