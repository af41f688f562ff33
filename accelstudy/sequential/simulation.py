"""Simulated sessions that choose their positions and stop when the promise is kept, in SI."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from accelstudy.adjustment import Observations
from accelstudy.approaches import Approach, get_approach
from accelstudy.basics.errors import InputError
from accelstudy.basics.progress import track
from accelstudy.basics.shares import clopper_pearson, sigmas_95
from accelstudy.basics.units import GON, MGON, STANDARD_GRAVITY
from accelstudy.design.estimability import estimability
from accelstudy.design.task import position_rows
from accelstudy.leveling.angles import angles_of
from accelstudy.leveling.error import TiltError, tilt_error
from accelstudy.schemes import get_scheme
from accelstudy.sensors.models import get_model
from accelstudy.sensors.sensor import SensorModel
from accelstudy.sequential.choice import DEFAULTS, Chooser, candidates, typical_sizes
from accelstudy.sequential.config import SequentialConfig
from accelstudy.sequential.estimate import Estimate, estimate
from accelstudy.sequential.promise import Promise, rms_of
from accelstudy.simulation.sessions import Noise

Array = NDArray[np.float64]

AT_ONCE = 500
"""Sessions that are simulated together; more would only take memory."""
ROUNDING = 1e-9
"""Relative excess over the promise that is rounding."""
CENTRAL = (0.05, 0.5, 0.95)
"""Quantiles of the numbers of positions."""


@dataclass(frozen=True)
class SetUp:
    """Sessions of one kind.

    Attributes
    ----------
    config : SequentialConfig
    approach : str
    rule : str, what the variance of unit weight is taken for
    multiple : float, promised accuracy over that of the fixed scheme
    """

    config: SequentialConfig
    approach: str
    rule: str
    multiple: float

    @cached_property
    def model(self) -> SensorModel:
        """Model of the sensor and of the calibration."""
        return get_model(self.config.model)

    @cached_property
    def equipment(self) -> Approach:
        """The approach."""
        return get_approach(self.approach)

    @cached_property
    def noise(self) -> Noise:
        """Noise of the observations."""
        return Noise(self.config.sigma_mps2, self.config.robot_sigma_mgon * MGON)

    @cached_property
    def fixed_rms(self) -> Array:
        """Rms of roll and of pitch that the fixed scheme leaves, (2,), rad; linear theory.

        Raises
        ------
        InputError
            If it does not determine the model.
        """
        scheme = get_scheme(self.config.instead_of)
        determined = estimability(scheme, self.model, self.equipment, self.noise)
        if not determined.estimable:
            raise InputError(f"sequential.instead_of: {scheme.name}: {determined.reason}")
        error = Promise(np.inf, self.config.tilt_range_gon * GON).tilt_error(self.model)
        return error.rms_of_all(determined.cofactors)

    @cached_property
    def promise(self) -> Promise:
        """Promised accuracy: a multiple of that of the fixed scheme."""
        accuracy = self.multiple * float(self.fixed_rms.max())
        return Promise(accuracy, self.config.tilt_range_gon * GON)

    @cached_property
    def chooser(self) -> Chooser:
        """The chooser of the positions."""
        directions = candidates(DEFAULTS.get(self.approach, "grid"))
        return Chooser(
            directions,
            position_rows(self.model, self.equipment, self.noise, directions),
            self.promise.tilt_error(self.model),
            self.promise,
            self.rule,
            typical_sizes(self.model, self.model.n_parameters),
        )

    @cached_property
    def attitudes(self) -> list[TiltError]:
        """Attitudes in which intervals are checked: level, and tilted by the tilt range."""
        sin, cos = np.sin(self.promise.tilt_range), np.cos(self.promise.tilt_range)
        down = [(0, 0, 1), (sin, 0, cos), (-sin, 0, cos), (0, sin, cos), (0, -sin, cos)]
        ideal = np.zeros(self.model.n_parameters)
        return [
            tilt_error(self.model, ideal, self.model, ideal, -STANDARD_GRAVITY * np.array([d]))
            for d in down
        ]

    @property
    def labels(self) -> dict[str, Any]:
        """Columns that identify the set-up of a row."""
        return {
            "approach": self.approach,
            "rule": self.rule,
            "multiple": self.multiple,
            "promised": self.promise.accuracy,
            "tilt_range": self.promise.tilt_range,
        }

    def rng(self, seed: int, part: int) -> np.random.Generator:
        """Random numbers of a part of the sessions; all rules share them, to be compared."""
        name = f"{self.config.model} {self.approach} {self.multiple}"
        digest = int.from_bytes(hashlib.sha256(name.encode()).digest()[:8], "big")
        return np.random.default_rng(np.random.SeedSequence([seed, digest], spawn_key=(part,)))


def set_ups(config: SequentialConfig, approach: str) -> list[SetUp]:
    """Set-ups of an approach."""
    pairs = [(rule, multiple) for rule in config.rules for multiple in config.accuracies]
    return [SetUp(config, approach, rule, multiple) for rule, multiple in pairs]


def sessions_table(config: SequentialConfig, approach: str, seed: int) -> pd.DataFrame:
    """All sessions of an approach, one row each: the columns of `simulate` and its set-up."""
    parts = []
    for set_up in track(set_ups(config, approach), "sessions"):
        parts.append(simulate(set_up, seed).assign(**set_up.labels))
    return pd.concat(parts, ignore_index=True)


def summary_table(config: SequentialConfig, sessions: pd.DataFrame) -> pd.DataFrame:
    """One row for each set-up, with the columns of `summarise`."""
    rows = []
    for approach in config.approaches:
        for set_up in set_ups(config, approach):
            chosen = (
                (sessions["approach"] == set_up.approach)
                & (sessions["rule"] == set_up.rule)
                & (sessions["multiple"] == set_up.multiple)
            )
            rows.append(summarise(set_up, sessions[chosen]))
    return pd.DataFrame(rows)


def simulate(set_up: SetUp, seed: int) -> pd.DataFrame:
    """Simulate all sessions of a set-up.

    Returns
    -------
    DataFrame
        A row for each session, angles in rad: the number of positions; the rms of roll and pitch
        that it claims, the one by the true noise, and the actual error of its calibration; the
        shares of intervals that contain the truth.
    """
    sizes = [AT_ONCE] * (set_up.config.sessions // AT_ONCE)
    sizes += [rest] if (rest := set_up.config.sessions % AT_ONCE) else []
    parts = [_simulate(set_up, size, set_up.rng(seed, i)) for i, size in enumerate(sizes)]
    return pd.concat(parts, ignore_index=True)


def _simulate(set_up: SetUp, sessions: int, rng: np.random.Generator) -> pd.DataFrame:
    model, chooser = set_up.model, set_up.chooser
    truth = _sensors(model, sessions, rng)
    nothing = np.zeros((sessions, 0, 3)), np.zeros((sessions, 0, 2))
    going, (forces, angles) = np.arange(sessions), nothing
    so_far = estimate(model, set_up.equipment, _observed(set_up, forces, angles))
    rms, last = np.full((sessions, 2), np.inf), None
    ended: list[pd.DataFrame] = []
    for n in range(1, set_up.config.most_positions + 1):
        chosen = chooser.choose(so_far.information, so_far.solved, rms, last)
        # Drawn for all sessions, so that none depends on which others have ended.
        off = set_up.config.placing_gon * GON * rng.standard_normal((sessions, 3))
        errors = rng.standard_normal((sessions, 3)), rng.standard_normal((sessions, 2))
        last = chooser.directions[chosen] + off[going]
        last /= np.linalg.norm(last, axis=1, keepdims=True)
        read = _measure(set_up, truth[going], last, *(error[going] for error in errors))
        forces, angles = (
            np.concatenate([before, new], axis=1)
            for before, new in zip((forces, angles), read, strict=True)
        )
        observed = _observed(set_up, forces, angles)
        so_far = estimate(model, set_up.equipment, observed, before=so_far)

        rms = np.full((len(going), 2), np.inf)
        ok = so_far.solved
        rms[ok] = chooser.rms(so_far.cofactors[ok], so_far.omega[ok], so_far.redundancy)
        done = set_up.promise.reached(rms)
        if done.any() or n == set_up.config.most_positions:
            over = done | (n == set_up.config.most_positions)
            row = _outcome(set_up, so_far.sessions(np.flatnonzero(over)), truth[going[over]])
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


def _sensors(model: SensorModel, count: int, rng: np.random.Generator) -> Array:
    """Parameters of sensors, (R, u), anywhere between typical sizes, of either sign."""
    low, high = np.log([e.typical for e in model.effects for _ in e.parameters]).T
    sizes = np.exp(rng.uniform(low, high, (count, len(low))))
    return np.asarray(sizes * rng.choice([-1.0, 1.0], sizes.shape))


def _measure(
    set_up: SetUp, truth: Array, directions: Array, noise: Array, angle_noise: Array
) -> tuple[Array, Array]:
    """Readings of one position each, forces (R, 1, 3) and the robot's angles (R, 1, 2)."""
    f_b = -STANDARD_GRAVITY * directions[:, None]
    force = set_up.model.sense(f_b, truth) + set_up.noise.sigma_force * noise[:, None]
    angles = angles_of(f_b)
    angles = angles + set_up.model.reading_errors(angles, truth)
    return force, angles + set_up.noise.sigma_angle * angle_noise[:, None]


def _observed(set_up: SetUp, forces: Array, angles: Array) -> Observations:
    noise = set_up.noise
    return Observations(forces, noise.sigma_force, angles, noise.sigma_angle, STANDARD_GRAVITY)


def _outcome(set_up: SetUp, so_far: Estimate, truth: Array) -> pd.DataFrame:
    """Results of sessions that have ended, one row each."""
    error, cofactors = set_up.chooser.error, so_far.cofactors
    delta = so_far.parameters - truth
    true_rms, actual = rms_of(error, cofactors), error.rms(delta)
    r = so_far.redundancy
    if set_up.rule == "known":
        width = np.full(len(truth), sigmas_95())
    else:
        sigma0 = np.sqrt(so_far.omega / r) if r > 0 else np.full(len(truth), np.nan)
        width = sigmas_95(r) * sigma0
    sigma = np.sqrt(np.diagonal(cofactors, axis1=1, axis2=2))
    inside = np.abs(delta) <= width[:, None] * sigma
    angles = np.stack([each.rms(delta) for each in set_up.attitudes], axis=1)
    spread = np.stack([rms_of(each, cofactors) for each in set_up.attitudes], axis=1)
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


def summarise(set_up: SetUp, sessions: pd.DataFrame) -> dict[str, Any]:
    """One row of the table: angles in rad, times in s, intervals of 95 %.

    `broken` is the share of sessions that stopped although, by the true noise, roll or pitch was
    not yet as accurate as promised. `rms` is over all sessions and attitudes, relative to the
    promise.
    """
    n, promised = len(sessions), set_up.promise.accuracy
    positions = sessions["positions"].to_numpy(dtype=float)
    true = sessions[["true_roll", "true_pitch"]].to_numpy().max(axis=1)
    broken = int(np.count_nonzero(sessions["kept"] & (true > promised * (1 + ROUNDING))))
    low, high = clopper_pearson(broken, n)
    # A posteriori at the end; to stop by it makes it too small.
    variance = sessions["omega"] / sessions["redundancy"].where(sessions["redundancy"] > 0)
    actual = (sessions[["actual_roll", "actual_pitch"]].to_numpy() / promised) ** 2
    # How often the fixed scheme must be measured in full for the same accuracy.
    rounds = int(np.ceil(round(set_up.multiple**-2, 9)))
    fixed = rounds * get_scheme(set_up.config.instead_of).n_positions
    row: dict[str, Any] = {
        **set_up.labels,
        "sessions": n,
        "kept": float(sessions["kept"].mean()),
        "positions": positions.mean(),
        **{f"positions_{int(100 * q)}": float(np.quantile(positions, q)) for q in CENTRAL},
        "fixed_positions": fixed,
        "saved_positions": fixed - positions.mean(),
        "saved_seconds": set_up.config.seconds * (fixed - positions.mean()),
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
