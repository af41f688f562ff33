"""Public logs into whose readings an effect is put: their noise is real, and so are their moves.

The effect, by a formula of `studies.hidden.physics`, is added to each reading, at the force that
the calibrated sensor felt then. What is calculated here takes nothing from the adjustment, the
effects and the diagnosis of the project.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import optimize, special

from accelstudy.basics.errors import InputError
from accelstudy.campaign.importing.logs import import_log
from accelstudy.campaign.importing.making import ImportReport
from accelstudy.campaign.importing.recording import read_log
from accelstudy.campaign.importing.settings import ImportSettings
from accelstudy.campaign.session import Campaign
from accelstudy.sensors.conversion import conversion_of
from studies.hidden.physics.atlas import Atlas, Conditions, Shape
from studies.hidden.physics.designs import ANGLE_SIGMA, GRAVITY, Course, Session, joints_of
from studies.hidden.physics.effects import EFFECTS
from studies.hidden.physics.kinds import OUTPUTS, Cause, Kind, Settings
from studies.hidden.physics.measuring import Sensor

Array = NDArray[np.float64]

BUMPED = "outlier_position"
PUT: Mapping[str, Kind] = {
    **{name: kind for name, kind in EFFECTS.items() if kind.target in OUTPUTS},
    BUMPED: Kind(
        BUMPED,
        "output",
        2e-2,
        lambda p, f, s, x: p * (np.arange(x.n) == s["row"])[:, None],
        settings=Settings(lambda x, rng: {"row": float(rng.integers(x.n))}),
    ),
}
"""What can be put into a log: effects of the sensor, and a bumped hold."""
BY_HOLD = ("hysteresis", "settling", BUMPED)
"""Effects that act from hold to hold, or in one; a single reading does not tell them."""


@dataclass(frozen=True, eq=False)
class Donor:
    """A public log as a sensor made it.

    Attributes
    ----------
    name : str
    settings : ImportSettings
    forces : (N, 3) array, m/s², readings, or means where the log has no others
    time : (N,) array, s
    timed : bool, whether the log itself gives the time
    spans : (n, 2) int array, first sample of each hold, and the one after its last
    own : tuple of str, an effect that it has by itself, by any of these names
    """

    name: str
    settings: ImportSettings
    forces: Array
    time: Array
    timed: bool
    spans: NDArray[np.int_]
    own: tuple[str, ...]

    @classmethod
    def opened(
        cls,
        name: str,
        path: Path,
        settings: ImportSettings,
        interval: float,
        own: Sequence[str] = (),
    ) -> Donor:
        """Read a log, and find its holds; without times one position takes an interval, s."""
        campaign, report = import_log(path, settings)
        spans = spans_of(campaign, report)
        if settings.means:
            forces = campaign.forces
        else:
            samples = read_log(path, settings).samples
            forces = samples.forces
        timed = not settings.means and settings.block is None
        if timed:
            time = samples.time
        else:
            middles = np.arange(len(forces)) + 0.5
            time = np.asarray(interval / (settings.block or 1) * middles, dtype=float)
        return cls(name, settings, forces, time, timed, spans, tuple(own))

    def means(self, values: Array, spans: NDArray[np.int_]) -> Array:
        """Means (..., n, 3) over holds of values (..., N, 3)."""
        return np.stack([values[..., a:b, :].mean(axis=-2) for a, b in spans], axis=-2)

    @cached_property
    def sensor(self) -> Sensor:
        """The sensor that measures the same force in all holds, by least squares."""
        means = self.means(self.forces, self.spans)

        def misclosures(p: Array) -> Array:
            sensor = Sensor(*p.reshape(3, 3))
            return np.linalg.norm((means - sensor.bias) @ sensor.correction.T, axis=1) - GRAVITY

        return Sensor(*optimize.least_squares(misclosures, np.zeros(9)).x.reshape(3, 3))

    @cached_property
    def felt(self) -> Array:
        """Forces along its axes that the sensor felt, (N, 3), m/s²."""
        return (self.forces - self.sensor.bias) / (1 + self.sensor.scale)

    @cached_property
    def hold_of(self) -> NDArray[np.int_]:
        """Hold to which each sample belongs, (N,); a move is shared by the holds around it."""
        middles = (self.spans[:-1, 1] + self.spans[1:, 0]) / 2
        return np.searchsorted(middles, np.arange(len(self.forces)), side="right")

    @property
    def redundancy(self) -> int:
        """That of a calibration with nine parameters, and with what the log has by itself."""
        return len(self.spans) - 9 - (EFFECTS[self.own[0]].k if self.own else 0)

    def atlas(self, spans: NDArray[np.int_], course: Course | None, sigma: float = 1.0) -> Atlas:
        """All that holds can show; what the log has by itself is absorbed."""
        n, means = len(spans), self.means(self.forces, spans)
        session = Session(
            self.name,
            joints_of((means - self.sensor.bias) @ self.sensor.correction.T),
            np.zeros(n),
            sigma,
            ANGLE_SIGMA,
            length=float(np.median(self.time[spans[:, 1] - 1] - self.time[spans[:, 0]])),
            time=(self.time[spans[:, 0]] + self.time[spans[:, 1] - 1]) / 2,
            course=course,
        )
        atlas = Atlas(session, Conditions.of(session, "gravity", self.sensor))
        for name in self.own[:1]:
            shape, known = atlas.shape(EFFECTS[name], {}), atlas.conditions.absorbed
            assert shape is not None
            absorbed = np.linalg.qr(np.concatenate([known, shape.basis], axis=1))[0]
            atlas = Atlas(session, replace(atlas.conditions, absorbed=absorbed))
        return atlas

    @cached_property
    def sigma(self) -> float:
        """Noise of a position mean, m/s², as the residuals of the log itself have it."""
        left = self.atlas(self.spans, None).conditions.seen(
            self.means(self.forces, self.spans)[None], np.zeros((1, len(self.spans), 2))
        )
        return float(np.sqrt(np.sum(left**2) / self.redundancy))

    def unit(self, kind: Kind, settings: dict[str, float], course: Course | None) -> Array:
        """What each parameter of a kind adds to the readings, (k, N, 3)."""
        felt, time, by_hold = self.felt, self.time, kind.name in BY_HOLD
        if by_hold:
            felt, time = self.means(felt, self.spans), time[self.spans[:, 0]]
        session = Session(
            self.name, np.zeros((len(time), 2)), time, 1.0, 1.0, time=time, course=course
        )
        added = Cause(kind, settings, np.eye(kind.k)).change(felt[None], session)
        return added[:, self.hold_of] if by_hold else added

    def write(
        self,
        path: Path,
        puts: Sequence[Cause],
        course: Course | None,
        columns: Mapping[str, Array],
    ) -> ImportSettings:
        """Write the log with effects in its readings, and columns; returns how it is imported."""
        given, added = self.settings, np.zeros(self.forces.shape)
        for one in puts:
            added += np.tensordot(one.parameters[0], self.unit(one.kind, one.settings, course), 1)
        conversion = conversion_of(given.unit, given.scale, given.offset)
        raw = conversion.from_si(given.axes.from_frd(self.forces + added))
        if given.unit == "counts":
            raw = np.round(raw)
        table = dict(zip(("fx", "fy", "fz"), raw.T, strict=True)) | dict(columns)
        if given.time is not None:
            table["time"] = self.time
        pd.DataFrame(table).to_parquet(path)
        return given.model_copy(
            update={
                "columns": {name: name for name in table if name != "time"},
                "time": "time" if "time" in table else None,
                "time_unit": "s",
                "variable": None,
            }
        )


def spans_of(campaign: Campaign, report: ImportReport) -> NDArray[np.int_]:
    """First sample of each hold that is used, and the one after its last, (n, 2)."""
    if report.holds is None:
        first = np.arange(campaign.n_positions)
        return np.column_stack([first, first + 1])
    used = [report.holds.segments[int(number)] for number in campaign.positions]
    return np.array([[segment.start, segment.end] for segment in used])


def put(
    name: str, size: float, log: Donor, course: Course | None, rng: np.random.Generator
) -> Cause:
    """Draw an effect that has a noncentrality in a log.

    Raises
    ------
    InputError
        If the log cannot show it.
    """
    kind, atlas = PUT[name], log.atlas(log.spans, course, log.sigma)
    settings = kind.settings.draw(atlas.session, rng)
    if "t" in settings:  # between two holds: what jumps within one is another effect
        between = (log.time[log.spans[:-1, 1] - 1] + log.time[log.spans[1:, 0]]) / 2
        settings["t"] = float(between[np.argmin(abs(between - settings["t"]))])
    left, shape = seen(log, log.spans, atlas, kind, settings)
    if shape is None:
        raise InputError(f"{log.name}: cannot show {name}")
    parameters = shape.drawn(rng)
    return Cause(
        kind, settings, parameters[None] * np.sqrt(size / np.sum((parameters @ left) ** 2))
    )


def seen(
    log: Donor,
    spans: NDArray[np.int_],
    atlas: Atlas,
    kind: Kind,
    settings: dict[str, float],
) -> tuple[Array, Shape | None]:
    """What each parameter of a kind leaves in holds, (k, m), of unit weight, and its shape."""
    holds = log.means(log.unit(kind, settings, atlas.session.course), spans)
    left = atlas.conditions.left(atlas.conditions.changed(holds))
    size = float(np.linalg.norm(holds)) / atlas.session.sigma / np.sqrt(kind.k)
    return left, Shape.of(kind, settings, left, size)


@dataclass(frozen=True)
class Shown:
    """What an effect shows in the holds of a log, all of unit weight.

    Attributes
    ----------
    cause : Cause
    spans : (n, 2) int array, of the holds
    atlas : Atlas, of the holds
    shape : Shape
    whole : (m,) array, residuals of a calibration
    beside : (m, d) array, orthonormal, what the other effects take up
    left : (k, m) array, what each parameter leaves
    redundancy : int
    """

    cause: Cause
    spans: NDArray[np.int_]
    atlas: Atlas
    shape: Shape
    whole: Array
    beside: Array
    left: Array
    redundancy: int

    def without(self, rows: Array) -> Array:
        """Residuals (..., m) without what the other effects take up."""
        return np.asarray(rows - (rows @ self.beside) @ self.beside.T)

    @property
    def true(self) -> Array:
        """What the effect left in the residuals, (m,), beside the others."""
        return self.without(self.cause.parameters[0] @ self.left)

    def f_test(self) -> tuple[float, float, float]:
        """p-value, size over true size, and its sigma, by an F test that knows the form."""
        z, true = self.without(self.whole), self.true
        basis = np.linalg.qr(self.without(self.shape.basis.T).T)[0]
        gain, d = float(np.sum((z @ basis) ** 2)), basis.shape[1]
        dof = self.redundancy - d
        variance = (float(z @ z) - gain) / dof
        p = float(special.fdtrc(d, dof, gain / d / variance))
        size = float(true @ true)
        return p, float(z @ true) / size, float(np.sqrt(variance / size))


def shown(
    log: Donor,
    spans: NDArray[np.int_],
    course: Course | None,
    causes: Sequence[Cause],
    forces: Array,
) -> list[Shown]:
    """What effects show in the holds of a log that was imported with them.

    Raises
    ------
    InputError
        If the holds cannot show one.
    """
    if not causes:
        return []
    atlas = log.atlas(spans, course, log.sigma)
    whole = atlas.conditions.seen(forces[None], np.zeros((1, len(spans), 2)))[0]
    found = [seen(log, spans, atlas, one.kind, one.settings) for one in causes]
    result = []
    for i, (cause, (left, shape)) in enumerate(zip(causes, found, strict=True)):
        if shape is None:
            raise InputError(f"{log.name}: its holds no longer show {cause.kind.name}")
        others = [other.basis for k, (_, other) in enumerate(found) if other and k != i]
        beside = np.concatenate([np.zeros((len(whole), 0)), *others], axis=1)
        redundancy = log.redundancy + len(spans) - len(log.spans) - beside.shape[1]
        result.append(Shown(cause, spans, atlas, shape, whole, beside, left, redundancy))
    return result
