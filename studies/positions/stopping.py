"""Whether sessions keep a promise that choose their positions and stop when it seems kept.

Each session has a sensor of its own. The noise is known; or it is unknown, and an upper confidence
bound of it is taken from the residuals, or what the residuals seem to say. The promise is a
multiple of the tilt accuracy that a fixed scheme has.
"""

from __future__ import annotations

import hashlib
from functools import partial
from itertools import product
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator
from numpy.typing import ArrayLike, NDArray
from scipy.stats import binomtest

from accelstudy.adjustment import Adjustment, Observations, calibrate
from accelstudy.adjustment.calibration import CalibrationProblem
from accelstudy.approaches import get_approach
from accelstudy.basics import units
from accelstudy.basics.arrays import Array
from accelstudy.basics.shares import sigmas_95
from accelstudy.design.estimability import estimability
from accelstudy.design.information import Information, position_rows
from accelstudy.drawing import style
from accelstudy.leveling.angles import angles_of, tilt_slope
from accelstudy.leveling.error import error_in_use
from accelstudy.schemes import get_scheme
from accelstudy.sensors.models import NINE, get_model
from accelstudy.sequential import choice
from accelstudy.sequential.promise import Promise, bound
from accelstudy.simulation.sessions import Noise

MODEL = get_model(NINE)  # of the sensor and of the calibration
FIXED = get_scheme("mclaren-24")
TILT_RANGE = 30 * units.GON
NOISE = Noise()
PLACING = 2 * units.GON  # sd per axis by which positions miss the chosen attitudes
MOST_POSITIONS = 120  # with which a session ends in any case
SEED = 1
ROUNDING = 1e-9  # relative excess over the promise that is rounding


def plain(omega: ArrayLike, redundancy: int) -> Array:
    """Variance of unit weight as the residuals seem to say, Ω/r."""
    return np.asarray(omega) / redundancy if redundancy > 0 else np.full(np.shape(omega), np.inf)


RULES: dict[str, tuple[Any, Any, str]] = {
    "known": (partial(bound, sigma_dof=np.inf), "-", "noise known"),
    "bound": (bound, "--", "upper bound from residuals"),
    "plain": (plain, ":", "as the residuals seem"),
}
"""What the variance of unit weight is taken for, its line in the figure, and its label there."""
SETTINGS = [*product(("gravity", "robot"), RULES, (0.75, 1.0, 1.5, 2.0), range(2))]
"""Approach, rule, promised accuracy over that of the fixed scheme, and block of sessions."""
LABELS = ["approach", "rule", "multiple", "promised"]
"""Columns that identify the setting of a session."""


def simulate(
    approach: str,
    rule: str,
    multiple: float = 1.0,
    block: int = 0,
    sessions: int = 500,
    most_positions: int = MOST_POSITIONS,
    seed: int = SEED,
) -> pd.DataFrame:
    """Simulate the sessions of a setting.

    Parameters
    ----------
    approach : str
    rule : str, of `RULES`
    multiple : float, promised accuracy over that of the fixed scheme, by linear theory
    block : int, another one has other sessions
    sessions : int
    most_positions : int, with which a session ends in any case
    seed : int

    Returns
    -------
    DataFrame
        A row for each session, angles in rad: the number of positions; the rms of roll and pitch
        by the true noise, and the actual error of its calibration; the shares of intervals that
        contain the truth.
    """
    cofactors = estimability(FIXED, MODEL, get_approach(approach), NOISE).cofactors
    error = error_in_use(MODEL, max_tilt=TILT_RANGE)
    promise = Promise(multiple * float(error.rms_of_all(cofactors).max()), TILT_RANGE)
    directions = choice.candidate_positions(choice.DEFAULTS[approach])
    rows = position_rows(MODEL, get_approach(approach), NOISE, directions)
    sizes = choice.typical_sizes(MODEL, MODEL.n_parameters)
    chooser = choice.Chooser(directions, rows, error, promise, RULES[rule][0], sizes)
    # All rules share the random numbers, to be compared.
    name = hashlib.sha256(f"{MODEL.name} {approach} {multiple}".encode()).digest()
    entropy = [seed, int.from_bytes(name[:8], "big")]
    rng = np.random.default_rng(np.random.SeedSequence(entropy, spawn_key=(block,)))
    low, high = np.log([e.typical for e in MODEL.effects for _ in e.parameters]).T
    truth = np.exp(rng.uniform(low, high, (sessions, len(low))))
    truth *= rng.choice([-1.0, 1.0], truth.shape)  # of sensors, anywhere between typical sizes
    forces, angles = np.zeros((sessions, 0, 3)), np.zeros((sessions, 0, 2))
    last: list[Array | None] = [None] * sessions
    going, ended = np.arange(sessions), []
    while True:
        known, result = _known(approach, forces, angles)
        rms, n = np.array([chooser.rms(each) for each in known]), forces.shape[1]
        kept = chooser.promise.is_kept(rms)
        over = kept | (n == most_positions)
        if over.any():
            assert result is not None  # so many positions determine the model
            outcome = _outcome(chooser, rule, result, truth[going], np.flatnonzero(over))
            ended.append(outcome.set_index(going[over]).assign(kept=kept[over], positions=n))
        further, going = np.flatnonzero(~over), going[~over]
        if not len(going):
            break
        chosen = [chooser.choose(known[i], rms[i], last[i]) for i in further]
        # Drawn for all sessions, so that those of one do not depend on when others end.
        placing, of_force, of_angle = (rng.standard_normal((sessions, k))[going] for k in (3, 3, 2))
        taken = chooser.directions[chosen] + PLACING * placing
        taken /= np.linalg.norm(taken, axis=1, keepdims=True)
        last, f_b = [*taken], -units.STANDARD_GRAVITY * taken[:, None]
        angle = angles_of(f_b)
        force = MODEL.sense(f_b, truth[going]) + NOISE.sigma_force * of_force[:, None]
        angle = angle + MODEL.reading_errors(angle, truth[going])
        angle = angle + NOISE.sigma_angle * of_angle[:, None]
        forces = np.hstack([forces[further], force])
        angles = np.hstack([angles[further], angle])
    table = pd.concat(ended).sort_index()
    table[LABELS] = approach, rule, multiple, promise.accuracy
    return table


def _known(
    approach: str, forces: Array, angles: Array
) -> tuple[list[choice.Knowledge], Adjustment | None]:
    """What each session tells so far, and the calibrations if there are enough conditions."""
    sigmas = NOISE.sigma_force, NOISE.sigma_angle
    observed = Observations(forces, sigmas[0], angles, sigmas[1], units.STANDARD_GRAVITY)
    problem = CalibrationProblem.of(MODEL, get_approach(approach), observed)
    rows = problem.rows(problem.initial)  # of raw readings
    redundancy, known = rows.shape[1] - MODEL.n_parameters, []
    result = None if redundancy < 0 else calibrate(MODEL, get_approach(approach), observed)
    for i, of_readings in enumerate(rows):
        if result is not None and result.converged[i]:
            information = Information.of_covariance(result.cofactors[i])
            known.append(choice.Knowledge(information, float(result.omega[i]), redundancy))
        else:
            known.append(choice.Knowledge(Information.of(of_readings), np.nan, redundancy))
    return known, result


def _outcome(
    chooser: choice.Chooser, rule: str, result: Adjustment, truth: Array, over: NDArray[np.int_]
) -> pd.DataFrame:
    """Results of sessions that have ended with as many positions, one row each."""
    r, cofactors, omega = result.redundancy, result.cofactors[over], result.omega[over]
    delta = result.parameters[over] - truth[over]
    width = sigmas_95() * np.ones((len(over), 1))
    if rule != "known":
        width = sigmas_95(r) * np.sqrt(omega[:, None] / r)
    # Intervals of angles are checked level, and tilted by the tilt range.
    sin, cos = np.sin(TILT_RANGE), np.cos(TILT_RANGE)
    down = np.array([(0, 0, 1), (sin, 0, cos), (-sin, 0, cos), (0, sin, cos), (0, -sin, cos)])
    f_b, ideal = -units.STANDARD_GRAVITY * down, np.zeros(MODEL.n_parameters)
    slopes = tilt_slope(MODEL, ideal, f_b, f_b, units.STANDARD_GRAVITY).reshape(-1, len(ideal))
    outcome = pd.DataFrame(index=range(len(over)))
    for what, rows in (("parameters", np.eye(len(ideal))), ("angles", slopes)):
        sigmas = np.sqrt(np.sum(rows @ cofactors * rows, axis=2))
        outcome[f"{what}_inside"] = np.mean(abs(delta @ rows.T) <= width * sigmas, axis=1)
    outcome[["true_roll", "true_pitch"]] = np.array([*map(chooser.error.rms_of_all, cofactors)])
    outcome[["actual_roll", "actual_pitch"]] = chooser.error.rms(delta)
    return outcome


def summary_table(sessions: pd.DataFrame) -> pd.DataFrame:
    """What the sessions of each setting come to, a row each: angles in rad, intervals of 95 %.

    `broken` is the share of sessions that stopped although, by the true noise, roll or pitch was
    not yet as accurate as promised. `rms` is over all sessions and attitudes, relative to the
    promise.
    """
    true, promised = sessions[["true_roll", "true_pitch"]].max(axis=1), sessions["promised"]
    groups = sessions.assign(
        broken=sessions["kept"] & (true > promised * (1 + ROUNDING)),
        rms_roll=(sessions["actual_roll"] / promised) ** 2,
        rms_pitch=(sessions["actual_pitch"] / promised) ** 2,
    ).groupby(LABELS, sort=False)
    table = groups[["kept", "positions", "broken", "parameters_inside", "angles_inside"]].mean()
    table[["rms_roll", "rms_pitch"]] = groups[["rms_roll", "rms_pitch"]].mean() ** 0.5
    table["sessions"] = groups.size()
    for percent in (5, 95):
        table[f"positions_{percent}"] = groups["positions"].quantile(percent / 100)
    counts = zip(groups["broken"].sum(), table["sessions"], strict=True)
    table[["broken_low", "broken_high"]] = [binomtest(*each).proportion_ci() for each in counts]
    return table.reset_index()


def stopping_figure(summary: pd.DataFrame) -> Figure:
    """Positions that a promise takes, and how often it is broken; of `summary_table`."""
    figure = style.new_figure(style.FULL, 92)
    left, right = figure.subplots(1, 2)
    for (approach, rule), rows in summary.groupby(["approach", "rule"], sort=False):
        part, (_, line, _) = rows.sort_values("promised"), RULES[str(rule)]
        colour, marker = style.approach_colour(str(approach)), style.approach_marker(str(approach))
        look: Any = {"color": colour, "marker": marker, "linestyle": line}
        x, share = units.to_display(part["promised"], "rad"), 100 * part["broken"].to_numpy()
        left.plot(x, part["positions"], **look)
        if rule != "plain":
            central = part["positions_5"], part["positions_95"]
            left.fill_between(x, *central, color=colour, alpha=0.12, linewidth=0)
        if rule == "known":
            of_fixed = units.to_display((part["promised"] / part["multiple"]).iloc[0], "rad")
            left.plot(of_fixed, FIXED.n_positions, "*", color=colour, ms=11, mec="white", zorder=5)
        ends = 100 * part[["broken_low", "broken_high"]].to_numpy().T
        right.errorbar(x, share, yerr=np.abs(ends - share), capsize=2, **look)
    tilt = f"{float(units.to_attitude(TILT_RANGE)):.0f} {units.attitude_unit()}"
    unit = units.display_unit("rad")
    for axes in (left, right):
        axes.set(xscale="log", xlabel=f"promised rms up to {tilt} of tilt [{unit}]")
        axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 3, 5)))
        axes.xaxis.set_major_formatter("{x:g}")
        axes.minorticks_off()
    left.set(ylabel="positions", ylim=(0, None))
    left.set_title("until the promise seems kept: mean, central 90 %", loc="left")
    right.set(ylabel="sessions [%]", ylim=(-2, 102))
    right.set_title("less accurate than promised", loc="left")
    right.axhline(5, color=style.INK, linewidth=0.6)
    right.annotate("5 %", (1, 5), xycoords=("axes fraction", "data"), fontsize=7,
                   xytext=(-2, 2), textcoords="offset points", ha="right")  # fmt: skip
    handles = style.approach_handles(summary["approach"].unique(), linestyle="-")
    for _, line, label in (RULES[rule] for rule in summary["rule"].unique()):
        handles.append(Line2D([], [], color=style.INK, linestyle=line, label=label))
    handles.append(
        Line2D([], [], color=style.INK, marker="*", ms=9, ls="", label=f"fixed: {FIXED.name}")
    )
    figure.legend(handles=handles, loc="outside upper center", ncols=3)
    return figure
