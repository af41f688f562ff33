"""Public logs into whose readings an effect is put: their noise is real, and so are their moves.

The effect, by a formula of `studies.hidden.physics`, is added to each reading, at the force that
the calibrated sensor felt then. What is calculated here takes nothing from the adjustment, the
effects and the diagnosis of the project.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import optimize, special

from accelstudy.basics.errors import InputError
from accelstudy.campaign.importing.holds import Holds
from accelstudy.campaign.importing.logs import import_log
from accelstudy.campaign.importing.settings import ImportSettings
from accelstudy.campaign.session import Campaign
from accelstudy.sensors.conversion import conversion_of
from studies.hidden.physics.conditions import Conditions, Shape
from studies.hidden.physics.designs import ANGLE_SIGMA, Course, Session
from studies.hidden.physics.generate import Case, HiddenEffect, Truth
from studies.hidden.physics.geometry import GRAVITY, Array, joints_of
from studies.hidden.physics.kinds import EFFECTS, GROSS_EFFECTS, OUTPUTS, Cause, Kind
from studies.hidden.physics.measuring import Sensor
from studies.hidden.physics.oracle import Oracle

Spans = NDArray[np.int_]  # first sample of each hold, and the one after its last, (n, 2)

(BUMPED,) = GROSS_EFFECTS
PUT: Mapping[str, Kind] = {
    **{name: kind for name, kind in EFFECTS.items() if kind.target in OUTPUTS},
    **GROSS_EFFECTS,
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
    own : sequence of str, an effect that it has by itself, by any of these names
    course : Course, of a temperature that acts on the sensor; None for none
    """

    course: Course | None = None

    def __init__(
        self, name: str, path: Path, given: ImportSettings, interval: float, own: Sequence[str] = ()
    ) -> None:
        self.name, self.settings, self.own = name, given, own
        campaign, holds = import_log(path, given)
        self.spans, self.timed = spans_of(campaign, holds), not given.means and given.block is None
        self.forces = campaign.forces if holds is None else holds.log.forces
        middles = np.arange(len(self.forces), dtype=float) + 0.5
        self.time = interval / (given.block or 1) * middles
        if holds is not None and self.timed:
            self.time = holds.log.time

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
        return len(self.spans) - 9 - sum(EFFECTS[name].k for name in self.own[:1])

    @cached_property
    def sigma(self) -> float:
        """Noise of a position mean, m/s², as the residuals of the log itself have it."""
        left = residuals(self.oracle(self.spans), means_of(self.forces, self.spans))
        return float(np.sqrt(np.sum(left**2) / self.redundancy))

    def oracle(self, spans: Spans, sigma: float = 1.0) -> Oracle:
        """All that holds can show; what the log has by itself is absorbed."""
        felt = (means_of(self.forces, spans) - self.sensor.bias) @ self.sensor.correction.T
        first, last = self.time[spans[:, 0]], self.time[spans[:, 1] - 1]
        length, time, still = (
            float(np.median(last - first)),
            (first + last) / 2,
            np.zeros(len(felt)),
        )
        noise = sigma, ANGLE_SIGMA, 0
        session = Session(self.name, joints_of(felt), still, *noise, length, time, self.course)
        knowing = Oracle(Conditions(session, "gravity", self.sensor))
        for name in self.own[:1]:
            shape = knowing.shape(EFFECTS[name], {})
            assert shape is not None
            knowing.conditions.absorb(shape.basis)
        return knowing

    def unit(self, kind: Kind, settings: dict[str, float]) -> Array:
        """What each parameter of a kind adds to the readings, (k, N, 3)."""
        felt, time = (self.forces - self.sensor.bias) / (1 + self.sensor.scale), self.time
        if kind.name in BY_HOLD:
            felt, time = means_of(felt, self.spans), time[self.spans[:, 0]]
        joints = np.zeros((len(time), 2))
        session = Session(self.name, joints, time, 1.0, 1.0, time=time, course=self.course)
        added = Cause(kind, settings, np.eye(kind.k)).change(felt[None], session)
        if kind.name not in BY_HOLD:
            return added
        # A move is shared by the holds around it.
        middles = (self.spans[:-1, 1] + self.spans[1:, 0]) / 2
        return added[:, np.searchsorted(middles, np.arange(len(self.forces)), side="right")]

    def shape(
        self, kind: Kind, settings: dict[str, float], knowing: Oracle, spans: Spans
    ) -> tuple[Array, Shape]:
        """What each parameter of a kind leaves in holds, (k, m), of unit weight, and its shape.

        Raises
        ------
        InputError
            If they cannot show it.
        """
        holds = means_of(self.unit(kind, settings), spans)
        left = knowing.conditions.left(knowing.conditions.changed(holds))
        size = float(np.linalg.norm(holds)) / knowing.session.sigma / np.sqrt(kind.k)
        shape = Shape.of(kind, settings, left, size)
        if shape is None:
            raise InputError(f"{self.name}: cannot show {kind.name}")
        return left, shape

    def drawn(self, name: str, size: float, rng: np.random.Generator) -> Cause:
        """Draw an effect that has a noncentrality in the log."""
        kind, knowing = PUT[name], self.oracle(self.spans, self.sigma)
        settings = kind.draw(knowing.session, rng)
        if "t" in settings:  # between two holds: what jumps within one is another effect
            starts, ends = self.spans.T
            between = (self.time[ends[:-1] - 1] + self.time[starts[1:]]) / 2
            settings["t"] = float(between[np.argmin(abs(between - settings["t"]))])
        left, shape = self.shape(kind, settings, knowing, self.spans)
        parameters = shape.drawn(rng)
        factor = np.sqrt(size / np.sum((parameters @ left) ** 2))
        return Cause(kind, settings, parameters[None] * factor, size)

    def changed(
        self, causes: Sequence[Cause], recorded: bool
    ) -> tuple[pd.DataFrame, ImportSettings]:
        """The log with effects in its readings, and how it is imported.

        If that is `recorded`, it has columns of the temperature and the time.
        """
        given, added = self.settings, np.zeros(self.forces.shape)
        for one in causes:
            added += np.tensordot(one.parameters[0], self.unit(one.kind, one.settings), 1)
        conversion = conversion_of(given.unit, given.scale, given.offset)
        raw = conversion.from_si(given.axes.from_frd(self.forces + added))
        raw = np.round(raw) if given.unit == "counts" else raw
        table = dict(zip(("fx", "fy", "fz"), raw.T, strict=True))
        if recorded and self.course is not None:
            table["temperature"] = np.round(self.course.at(self.time), 1)
        columns, time = {name: name for name in table}, None
        if given.time is not None or (recorded and not self.timed):
            table["time"], time = self.time, "time"
        layout = {"columns": columns, "time": time, "time_unit": "s", "variable": None}
        layout |= {"name": given.name or self.name}
        return pd.DataFrame(table), given.model_copy(update=layout)


def means_of(values: Array, spans: Spans) -> Array:
    """Means (..., n, 3) over holds of values (..., N, 3)."""
    return np.stack([values[..., a:b, :].mean(axis=-2) for a, b in spans], axis=-2)


def spans_of(campaign: Campaign, holds: Holds | None) -> Spans:
    """Samples of each hold that is used."""
    if holds is None:
        first = np.arange(campaign.n_positions)
        return np.column_stack([first, first + 1])
    return holds.table.loc[campaign.positions, ["start", "end"]].to_numpy()


def residuals(knowing: Oracle, forces: Array) -> Array:
    """Residuals (m,) of unit weight of a calibration by forces (n, 3)."""
    return knowing.conditions.seen(forces[None], np.zeros((1, len(forces), 2)))[0]


def p_value(z: Array, shapes: Sequence[Shape], redundancy: int) -> float:
    """p-value of an F test that knows the form of effects, of two that of the less certain one.

    Parameters
    ----------
    z : (m,) array, residuals of a calibration with the effects
    shapes : what each of them leaves in the holds
    redundancy : int, of the calibration
    """

    def squares(fitted: Sequence[Shape]) -> float:
        basis = np.concatenate([np.zeros((len(z), 0)), *(one.basis for one in fitted)], axis=1)
        return float(np.sum((z - basis @ np.linalg.lstsq(basis, z)[0]) ** 2))

    p, full, dof = 0.0, squares(shapes), redundancy - sum(one.dim for one in shapes)
    for one in shapes:
        gain = squares([other for other in shapes if other is not one]) - full
        p = max(p, float(special.fdtrc(one.dim, dof, gain / one.dim / (full / dof))))
    return p


# --- campaigns ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class LogCase(Case):
    """A kind of campaign of a log.

    Attributes
    ----------
    recorded : bool, whether the columns on which effects depend are there; None if they need none
    """

    approach: str = "gravity"
    sigma_known: bool = False
    recorded: bool | None = None

    @property
    def session(self) -> str:
        """Log, effects and their size."""
        return f"{self.design}/{self.what or 'nothing'}/{self.size:g}"

    @property
    def name(self) -> str:
        """Name, unique within a study."""
        columns = {None: "as it is", True: "recorded", False: "not recorded"}[self.recorded]
        return f"{self.session}/{columns}"

    def seed(self, seed: int, campaign: int) -> np.random.SeedSequence:
        """Seed of a campaign: with and without its columns it is the same session."""
        return np.random.SeedSequence([seed, zlib.crc32(self.session.encode()), campaign])


def changed_log(log: Donor, case: LogCase, seed: np.random.SeedSequence) -> tuple[Campaign, Truth]:
    """Put effects into a log, and import it."""
    rng = np.random.default_rng(seed)
    if any("temperature" in PUT[name].needs for name in case.effect) or not case.effect:
        log = copy(log)
        log.course = _course(float(log.time[-1]), rng)
    causes = [log.drawn(name, lam, rng) for name, lam in zip(case.effect, case.lam, strict=True)]
    campaign, holds = import_log(*log.changed(causes, bool(case.recorded)))
    truth = Truth(tuple(map(HiddenEffect.of, causes)))
    if not causes:
        return campaign, truth
    spans = spans_of(campaign, holds)
    knowing, lost = log.oracle(spans, log.sigma), len(log.spans) - len(spans)
    shapes = [log.shape(one.kind, one.settings, knowing, spans)[1] for one in causes]
    z = residuals(knowing, campaign.forces)
    truth = replace(truth, p_known=p_value(z, shapes, log.redundancy - lost))
    if BUMPED in case.effect:
        # The hold in which the bumped one lies, whatever its number became.
        middle = np.mean(log.spans[int(causes[0].settings["row"])])
        place = campaign.positions[(spans[:, 0] <= middle) & (middle < spans[:, 1])].tolist()
        gross = {"name": BUMPED, "settings": {"position": place[0] if place else None}}
        return campaign, replace(truth, gross=gross)
    said = knowing.judge(z, case.lam)
    return campaign, replace(truth, classes=tuple(map(knowing.same_as, shapes)), oracle=said)


def _course(duration: float, rng: np.random.Generator) -> Course:
    """A temperature that rises to a limit, or wanders."""
    time = np.linspace(0.0, duration, 60)
    if rng.random() < 0.5:
        slow = duration * rng.uniform(0.2, 1.0)
        return Course(time, 21 + rng.uniform(4, 15) * -np.expm1(-time / slow))
    turns, start = rng.uniform(0.4, 3.0, 3), rng.uniform(0, 2 * np.pi, 3)
    waves = np.sin(2 * np.pi * np.outer(time / duration, turns) + start)
    return Course(time, 24 + waves @ rng.uniform(1, 3, 3))
