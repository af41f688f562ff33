"""The logs of one sensor, one after the other: all samples that lack no reading, checked."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError
from accelstudy.basics.units import CLOCK_UNITS, UNITS
from accelstudy.basics.wording import plural
from accelstudy.campaign.importing.columns import AXES
from accelstudy.campaign.importing.log import Log, forces_of

Array = NDArray[np.float64]

MAX_BAD_SHARE = 0.05
"""Share of rows without a usable reading from which on a log is refused."""
MAX_NAMED = 3
"""Rows that are named of those left out."""
GAP_RATIO = 5.0
"""A step of time that is this many times the usual one is a gap."""
_USUAL_RATE = 100.0
"""1/s; of several units of time the likely one gives the rate nearest to it."""


class Recording:
    """The logs of one sensor, often only one, in their order: all rows that lack no reading.

    Parameters
    ----------
    parts : sequence of Log

    Attributes
    ----------
    parts
    first : Log, which has the layout of all
    samples : DataFrame, those of the parts, by their rows in these; the times count from the first
        sample and, if the times of the parts do not tell, each begins where the last one ends
    forces : (n, 3) array, m/s², of the samples; each axis in one piece
    time : (n,) array, s
    step : float, s, usual time between two samples: the mean, without gaps. Steps may jitter or be
        multiples of a clock's tick. So the median may be far from the mean, and only the mean fits
        the number of samples
    starts : (k,) array, s, time of the first sample of each part as written in its file; NaN
        without any
    timed : bool, whether the times of the parts count from one zero, so that they follow each other
    lengths : list of int, samples of each part

    Raises
    ------
    InputError
        If time does not increase, a channel is constant, a log is empty, or many rows lack a
        reading.
    """

    def __init__(self, parts: Sequence[Log]) -> None:
        self.parts, self.first = parts, parts[0]
        self.path = self.first.path
        whole = [_checked_samples(part, alone=len(parts) == 1) for part in parts]
        self.step = self._usual_step(whole)
        firsts = [samples["time"].iloc[0] for samples in whole]
        self.starts = np.array([part.start for part in parts]) + firsts
        self.timed = bool(np.all(np.diff(self.starts) > 0))
        end = 0.0
        for i, (part, first) in enumerate(zip(parts, firsts, strict=True)):
            start = self.starts[i] - self.starts[0] if i and self.timed else end
            if i and start < end - self.step / 2:  # a clock rounds
                raise InputError(f"{part.path}: begins before the recording before it ends")
            shift = start - (first if "time" in part.places else 0.0)
            if shift:
                whole[i] = whole[i].assign(time=whole[i]["time"] + shift)
            end = whole[i]["time"].iloc[-1] + self.step
        self.samples = pd.concat(whole, join="inner") if whole[1:] else whole[0]
        self.lengths = [len(each) for each in whole]
        self.time, self.forces = self.samples["time"].to_numpy(), forces_of(self.samples)

    @property
    def conditions(self) -> list[str]:
        """What all parts have besides forces and time."""
        return [*self.samples.columns[4:]]

    @property
    def part(self) -> NDArray[np.int_]:
        """Number of the part of each sample, from 0, (n,)."""
        return np.repeat(np.arange(len(self.parts)), self.lengths)

    def _usual_step(self, whole: Sequence[pd.DataFrame]) -> float:
        """Usual time between two samples, s, which is that of all parts."""
        steps = [
            usual_step(np.diff(samples["time"]))
            if "time" in part.places
            else 1.0 / (part.layout.rate_hz or 1.0)
            for part, samples in zip(self.parts, whole, strict=True)
        ]
        odd = [i for i, step in enumerate(steps) if not 0.9 < step / steps[0] < 1.1]
        if odd:
            raise InputError(
                f"{self.parts[odd[0]].path}: {1 / steps[odd[0]]:.6g} samples per second, but "
                f"{1 / steps[0]:.6g} in {self.path}"
            )
        return float(np.mean(steps))

    def warnings(self) -> list[str]:
        """What could not be read."""
        said: list[str] = []
        for part in self.parts:
            said += part.source.warnings
            if part.lost.any():
                rows = np.flatnonzero(part.lost)
                each = "; ".join(part.describe(row) for row in rows[:MAX_NAMED].tolist())
                more = "; …" if len(rows) > MAX_NAMED else ""
                said.append(
                    f"{len(rows)} of {plural(len(part.lost), 'row')} left out, as a reading is "
                    f"missing or absurd: {each}{more}"
                )
        return said

    def unit_hint(self) -> str:
        """Hint at the unit of time that would give a usual rate; empty if the rate is usual."""
        if "time" not in self.first.places:
            return ""
        step = self.step / self.first.time_factor
        rates = {unit: 1 / (step * UNITS["s"][unit]) for unit in CLOCK_UNITS}
        unit = min(rates, key=lambda unit: abs(np.log(rates[unit] / _USUAL_RATE)))
        if UNITS["s"][unit] == self.first.time_factor:
            return ""
        return (
            f"; if its times are in {unit}, there are {rates[unit]:.4g} samples per second: give "
            f"`time_unit` {unit}"
        )


def _checked_samples(log: Log, alone: bool) -> pd.DataFrame:
    """Samples of a log that lack nothing; those of a part of a recording need not change."""
    lost, place = log.lost, log.places.get("time")
    samples = log.samples[~lost] if lost.any() else log.samples
    if place is not None and (backward := np.diff(samples["time"]) <= 0).any():
        row = int(samples.index[1 + int(np.argmax(backward))])
        where, cell = log.source.look_up(row, place)
        raise InputError(
            f"{log.path}: {where}, column {log.source.names[place]} (time): time does not "
            f"increase ({cell}); the rate (`rate`) does without it"
        )
    if lost.sum() > MAX_BAD_SHARE * len(lost):
        row = int(np.argmax(lost))
        hint = "; give the rate (`rate`) instead" if log.lacking(row)[0] == "time" else ""
        raise InputError(
            f"{log.path}: {log.describe(row)}, not a usable number{hint}; {lost.sum()} of "
            f"{plural(len(lost), 'row')} lack one, which are too many"
        )
    if len(samples) < 2:
        raise InputError(f"{log.path}: too few samples ({len(samples)})")
    # In a single position, a channel of a coarse sensor may be constant.
    constant = [bool((force == force[0]).all()) for force in forces_of(samples).T]
    if alone and any(constant):
        axis = AXES[min(log.layout.axes.order[np.array(constant)])]
        name = log.source.names[log.places[axis]]
        raise InputError(f"{log.path}: column {name} ({axis}) is constant")
    return samples


def usual_step(steps: Array) -> float:
    """Mean step of time, without gaps: steps of `GAP_RATIO` times the mean or more."""
    kept = steps
    while True:
        mean = float(np.mean(kept))
        without = steps[steps <= GAP_RATIO * mean]
        if len(without) == len(kept):
            return mean
        kept = without
