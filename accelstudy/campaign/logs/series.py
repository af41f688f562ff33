"""Several logs of one sensor, for example one file for each position."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from accelstudy.basics.errors import InputError
from accelstudy.campaign.logs.recording import CONDITIONS, Log, Rows


@dataclass(frozen=True)
class LogSeries:
    """Several logs of one sensor, each a recording of its own.

    Attributes
    ----------
    parts : tuple of Log, in their order
    """

    parts: Sequence[Log]

    @property
    def path(self) -> Path:
        """First of the files."""
        return self.parts[0].path

    @property
    def conditions(self) -> tuple[str, ...]:
        """Conditions that all parts have."""
        return tuple(k for k in CONDITIONS if all(k in part.places for part in self.parts))

    @cached_property
    def step(self) -> float:
        """Usual time between two samples, s."""
        steps = [part.step for part in self.parts]
        odd = [i for i, step in enumerate(steps) if not 0.9 < step / steps[0] < 1.1]
        if odd:
            raise InputError(
                f"{self.parts[odd[0]].path}: {1 / steps[odd[0]]:.6g} samples per second, but "
                f"{1 / steps[0]:.6g} in {self.parts[0].path}"
            )
        return float(np.mean(steps))

    @cached_property
    def timed(self) -> bool:
        """Whether the times of the parts count from one zero, so that they follow each other."""
        starts = np.array([part.start for part in self.parts])
        return bool(np.all(np.diff(starts) > 0))

    def likely_unit(self) -> str:
        """See `Recording`."""
        return self.parts[0].likely_unit()

    def chunks(self) -> Iterator[Rows]:
        """Samples of all parts; if their times do not tell, each begins where the last one ends."""
        end = 0.0
        for part in self.parts:
            start = part.start - self.parts[0].start if self.timed else end
            if start < end - self.step / 2:  # a clock rounds
                raise InputError(f"{part.path}: begins before the recording before it ends")
            columns = [part.conditions.index(key) for key in self.conditions]
            anew = True
            for rows in part.chunks():
                yield Rows(rows.time + start, rows.forces, rows.conditions[:, columns], anew)
                anew, end = False, start + rows.time[-1] + self.step
