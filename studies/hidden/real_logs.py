"""Public logs into whose readings an effect is put: their noise is real, and so are their moves.

The effect, by a formula of `studies.hidden.physics`, is added to each reading, at the force that
the calibrated sensor felt then. What is calculated here takes nothing from the adjustment, the
effects and the diagnosis of the project.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import optimize, special

from accelstudy.basics.errors import InputError
from accelstudy.campaign.importing.detection import Holds
from accelstudy.campaign.importing.logs import import_log
from accelstudy.campaign.importing.recording import Recording, read_log
from accelstudy.campaign.importing.settings import ImportSettings
from accelstudy.campaign.session import Campaign
from accelstudy.sensors.conversion import conversion_of
from studies.hidden.physics.atlas import Atlas, Conditions, Shape
from studies.hidden.physics.designs import ANGLE_SIGMA, Course, Session
from studies.hidden.physics.effects import EFFECTS
from studies.hidden.physics.geometry import GRAVITY, Array, joints_of
from studies.hidden.physics.kinds import OUTPUTS, Cause, Kind, Setting
from studies.hidden.physics.measuring import Sensor

Spans = NDArray[np.int_]
"""First sample of each hold, and the one after its last, (n, 2)."""

BUMPED = "outlier_position"
PUT: Mapping[str, Kind] = {
    **{name: kind for name, kind in EFFECTS.items() if kind.target in OUTPUTS},
    BUMPED: Kind(
        BUMPED,
        "output",
        "p * (number == row)",
        typical=2e-2,
        row=Setting(lambda x, rng: float(rng.integers(x.n))),
    ),
}
"""What can be put into a log: effects of the sensor, and a bumped hold."""
BY_HOLD = ("hysteresis", "settling", BUMPED)
"""Effects that act from hold to hold, or in one; a single reading does not tell them."""


class Donor:
    """A public log as a sensor made it.

    Attributes
    ----------
    forces : (N, 3) array, m/s², readings, or means where the log has no others
    time : (N,) array, s; without times one position takes an interval, s
    timed : bool, whether the log itself gives the time
    spans : Spans
    own : tuple of str, an effect that it has by itself, by any of these names
    """

    def __init__(
        self,
        name: str,
        path: Path,
        settings: ImportSettings,
        interval: float,
        own: Sequence[str] = (),
    ) -> None:
        self.name, self.settings, self.own = name, settings, own
        campaign, holds = import_log(path, settings)
        self.spans, self.forces = spans_of(campaign, holds), campaign.forces
        self.timed = not settings.means and settings.block is None
        if not settings.means:
            samples = Recording([read_log(path, settings, untimed=not self.timed)])
            self.forces = samples.forces
        middles = np.arange(len(self.forces), dtype=float) + 0.5
        self.time = samples.time if self.timed else interval / (settings.block or 1) * middles

    @cached_property
    def sensor(self) -> Sensor:
        """The sensor that measures the same force in all holds, by least squares."""
        means = means_of(self.forces, self.spans)

        def misclosures(p: Array) -> Array:
            sensor = Sensor(*p.reshape(3, 3))
            return np.linalg.norm((means - sensor.bias) @ sensor.correction.T, axis=1) - GRAVITY

        return Sensor(*optimize.least_squares(misclosures, np.zeros(9)).x.reshape(3, 3))

    @property
    def redundancy(self) -> int:
        """That of a calibration with nine parameters, and with what the log has by itself."""
        return len(self.spans) - 9 - (EFFECTS[self.own[0]].k if self.own else 0)

    def atlas(self, spans: Spans, course: Course | None, sigma: float = 1.0) -> Atlas:
        """All that holds can show; what the log has by itself is absorbed."""
        n, means, (starts, ends) = len(spans), means_of(self.forces, spans), spans.T
        session = Session(
            self.name,
            joints_of((means - self.sensor.bias) @ self.sensor.correction.T),
            np.zeros(n),
            sigma,
            ANGLE_SIGMA,
            length=float(np.median(self.time[ends - 1] - self.time[starts])),
            time=(self.time[starts] + self.time[ends - 1]) / 2,
            course=course,
        )
        atlas = Atlas(Conditions(session, "gravity", self.sensor))
        for name in self.own[:1]:
            shape = atlas.shape(EFFECTS[name], {})
            assert shape is not None
            atlas.conditions.absorb(shape.basis)
        return atlas

    @cached_property
    def sigma(self) -> float:
        """Noise of a position mean, m/s², as the residuals of the log itself have it."""
        left = residuals(self.atlas(self.spans, None), means_of(self.forces, self.spans))
        return float(np.sqrt(np.sum(left**2) / self.redundancy))

    def unit(self, kind: Kind, settings: dict[str, float], course: Course | None) -> Array:
        """What each parameter of a kind adds to the readings, (k, N, 3)."""
        felt, time = (self.forces - self.sensor.bias) / (1 + self.sensor.scale), self.time
        if kind.name in BY_HOLD:
            felt, time = means_of(felt, self.spans), time[self.spans[:, 0]]
        session = Session(
            self.name, np.zeros((len(time), 2)), time, 1.0, 1.0, time=time, course=course
        )
        added = Cause(kind, settings, np.eye(kind.k)).change(felt[None], session)
        if kind.name not in BY_HOLD:
            return added
        # A move is shared by the holds around it.
        middles = (self.spans[:-1, 1] + self.spans[1:, 0]) / 2
        return added[:, np.searchsorted(middles, np.arange(len(self.forces)), side="right")]

    def shape(
        self, kind: Kind, settings: dict[str, float], atlas: Atlas, spans: Spans
    ) -> tuple[Array, Shape]:
        """What each parameter of a kind leaves in holds, (k, m), of unit weight, and its shape.

        Raises
        ------
        InputError
            If they cannot show it.
        """
        holds = means_of(self.unit(kind, settings, atlas.session.course), spans)
        left = atlas.conditions.left(atlas.conditions.changed(holds))
        size = float(np.linalg.norm(holds)) / atlas.session.sigma / np.sqrt(kind.k)
        shape = Shape.of(kind, settings, left, size)
        if shape is None:
            raise InputError(f"{self.name}: cannot show {kind.name}")
        return left, shape

    def drawn(
        self, name: str, size: float, course: Course | None, rng: np.random.Generator
    ) -> Cause:
        """Draw an effect that has a noncentrality in the log."""
        kind, atlas = PUT[name], self.atlas(self.spans, course, self.sigma)
        settings = kind.draw(atlas.session, rng)
        if "t" in settings:  # between two holds: what jumps within one is another effect
            starts, ends = self.spans.T
            between = (self.time[ends[:-1] - 1] + self.time[starts[1:]]) / 2
            settings["t"] = float(between[np.argmin(abs(between - settings["t"]))])
        left, shape = self.shape(kind, settings, atlas, self.spans)
        parameters = shape.drawn(rng)
        factor = np.sqrt(size / np.sum((parameters @ left) ** 2))
        return Cause(kind, settings, parameters[None] * factor)

    def write(
        self,
        path: Path,
        causes: Sequence[Cause],
        course: Course | None,
        columns: Mapping[str, Array],
    ) -> ImportSettings:
        """Write the log with effects in its readings, and columns; returns how it is imported."""
        given, added = self.settings, np.zeros(self.forces.shape)
        for one in causes:
            added += np.tensordot(one.parameters[0], self.unit(one.kind, one.settings, course), 1)
        conversion = conversion_of(given.unit, given.scale, given.offset)
        raw = conversion.from_si(given.axes.from_frd(self.forces + added))
        if given.unit == "counts":
            raw = np.round(raw)
        table = {**dict(zip(("fx", "fy", "fz"), raw.T, strict=True)), **columns}
        if given.time is not None:
            table["time"] = self.time
        pd.DataFrame(table).to_parquet(path)
        layout = {
            "columns": {name: name for name in table if name != "time"},
            "time": "time" if "time" in table else None,
            "time_unit": "s",
            "variable": None,
        }
        return given.model_copy(update=layout)


def means_of(values: Array, spans: Spans) -> Array:
    """Means (..., n, 3) over holds of values (..., N, 3)."""
    return np.stack([values[..., a:b, :].mean(axis=-2) for a, b in spans], axis=-2)


def spans_of(campaign: Campaign, holds: Holds | None) -> Spans:
    """Samples of each hold that is used."""
    if holds is None:
        first = np.arange(campaign.n_positions)
        return np.column_stack([first, first + 1])
    return holds.table.loc[campaign.positions, ["start", "end"]].to_numpy()


def residuals(atlas: Atlas, forces: Array) -> Array:
    """Residuals (m,) of unit weight of a calibration by forces (n, 3)."""
    return atlas.conditions.seen(forces[None], np.zeros((1, len(forces), 2)))[0]


def p_value(log: Donor, z: Array, shapes: Sequence[Shape], holds: int) -> float:
    """p-value of an F test that knows the form of effects, of two that of the less certain one.

    Parameters
    ----------
    log : Donor, of which so many holds are left
    z : (m,) array, residuals of a calibration with the effects
    shapes : what each of them leaves in the holds
    """
    p = 0.0
    for shape in shapes:
        others = [one.basis for one in shapes if one is not shape]
        beside = np.concatenate([np.zeros((len(z), 0)), *others], axis=1)
        left = z - beside @ (beside.T @ z)
        basis = np.linalg.qr(shape.basis - beside @ (beside.T @ shape.basis))[0]
        gain, d = float(np.sum((left @ basis) ** 2)), basis.shape[1]
        dof = log.redundancy - (len(log.spans) - holds) - beside.shape[1] - d
        variance = (float(left @ left) - gain) / dof
        p = max(p, float(special.fdtrc(d, dof, gain / d / variance)))
    return p
