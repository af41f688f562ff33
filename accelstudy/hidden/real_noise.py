"""Real noise: known effects are put into the readings of public logs, and have to be found again.

The noise, the attitudes, the moves and the drifts are those of the log. The effect, by a formula of
`accelstudy.hidden.physics`, is added to each reading, at the force that the calibrated sensor feels
then. Import and diagnosis get the changed log. Beside their answer stands what an F test says that
knows the form of the effect.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from pydantic import Field
from scipy import optimize, special

from accelstudy.basics.errors import InputError, UnknownNameError
from accelstudy.campaign.importing.logs import import_log, log_of
from accelstudy.campaign.importing.public import import_settings, public_file
from accelstudy.campaign.importing.making import ImportReport
from accelstudy.campaign.importing.settings import ImportSettings
from accelstudy.campaign.session import Campaign
from accelstudy.config_names import ModelName
from accelstudy.effects import get_effect
from accelstudy.diagnosis.pipeline import judge
from accelstudy.diagnosis.result import Verdict
from accelstudy.files.reading import config_hash
from accelstudy.files.tables import write_table
from accelstudy.files.validation import Block, OneOrMore, PathName, Positive, Replicates, Seed, checked
from accelstudy.hidden.campaigns import SCHEMA, Row, tried
from accelstudy.hidden.cells import family_of
from accelstudy.hidden.diagnosing import outcome
from accelstudy.hidden.judging import all_true
from accelstudy.hidden.judging import judge as judged
from accelstudy.hidden.physics.atlas import Atlas, Conditions, Shape
from accelstudy.hidden.physics.designs import ANGLE_SIGMA, GRAVITY, Course, Session, joints_of
from accelstudy.hidden.physics.effects import EFFECTS, Effect
from accelstudy.hidden.physics.measuring import Sensor
from accelstudy.hidden.physics.oracle import CREDIBLE, Oracle
from accelstudy.sensors.conversion import conversion_of
from accelstudy.sensors.models import get_model

Array = NDArray[np.float64]

BUMPED = "outlier_position"
PUT: Mapping[str, Effect] = {
    **EFFECTS,
    BUMPED: Effect(
        BUMPED,
        3,
        2e-2,
        sensor=lambda f, p, s, session: p * (np.arange(session.n) == s["row"])[:, None],
        draw=lambda session, rng: {"row": float(rng.integers(session.n))},
    ),
}
"""What can be put into a log."""
BY_HOLD = ("hysteresis", "settling", BUMPED)
"""Effects that act from hold to hold, or in one; a single reading does not tell them."""
FEWEST = 5
"""Redundancy of a log, below which nothing is put into it."""


class Log(Block):
    """A public log, and what is true of it as it is."""

    model: ModelName | None = Field(None, description="model, by default that of the study")
    own: list[str] = Field([], description="names of an effect that it has by itself, any of them")
    note: str = Field(description="what is true of it, as the score shall say")


class RealNoiseConfig(Block):
    """A study with real noise; results go to ``results/<study>``."""

    study: PathName = Field(description="name; results go to results/<study>/")
    seed: Seed = Field(description="of all that is put in")
    model: ModelName = Field("bias-scale-nonorthogonality", description="model that is diagnosed")
    diagnosis_seed: Seed = Field(1, description="of each diagnosis, as the option --seed")
    public_folder: str = Field(
        "resources/public", description="where the logs are, or are downloaded to"
    )
    interval_s: Positive = Field(
        30.0, description="from one position to the next, where a log has no time"
    )
    logs: dict[PathName, Log] = Field(min_length=1, description="public data by name")
    sizes: OneOrMore[Positive] = Field(description="noncentralities λ")
    effects: OneOrMore[str] = Field(description="what is put in: one effect, or two as a+b")
    nothing: Replicates = Field(
        description="campaigns of each log into which nothing is put: the first as the log is, the "
        "others with a temperature (and a time) recorded that does nothing"
    )

    @property
    def fingerprint(self) -> str:
        """Hash of all that the numbers depend on."""
        return config_hash(self.model_dump(mode="json", exclude={"public_folder"}))


def parse_real_noise(content: Mapping[str, Any], source: str = "config") -> RealNoiseConfig:
    """Check a configuration; raise `InputError` with one line that names the source and the key."""
    config = checked(RealNoiseConfig, content, source)
    for name in config.logs:
        import_settings(name)
    for name in {one for each in config.effects for one in each.split("+")}:
        if name not in PUT or PUT[name].sensor is None:
            raise InputError(f"{source}: effects: {UnknownNameError('effect', name, PUT)}")
    return config


@dataclass(frozen=True)
class Case:
    """What is put into a log.

    Attributes
    ----------
    log : str
    effects : tuple of str; empty for nothing
    size : float, noncentrality λ of each
    recorded : bool, whether the columns on which they depend are there; None if they need none
    number : int, of campaigns that differ in nothing else
    """

    log: str
    effects: tuple[str, ...] = ()
    size: float = np.nan
    recorded: bool | None = None
    number: int = 0

    @property
    def what(self) -> str:
        """Names of the effects."""
        return "+".join(self.effects) or "nothing"

    @property
    def name(self) -> str:
        """Name, unique within a study."""
        columns = {None: "as it is", True: "recorded", False: "not recorded"}[self.recorded]
        return f"{self.log}/{self.what}/{self.size:g}/{columns}"

    def rng(self, seed: int) -> np.random.Generator:
        """Random numbers of this case, whatever other cases there are."""
        words = [seed, zlib.crc32(self.name.encode()), self.number]
        return np.random.default_rng(np.random.SeedSequence(words))


def cases_of(config: RealNoiseConfig, log: Donor) -> Iterator[Case]:
    """All that is put into a log."""
    for number in range(config.nothing):
        yield Case(log.name, recorded=True if number else None, number=number)
    for effects in config.effects if log.redundancy >= FEWEST else ():
        names = tuple(effects.split("+"))
        needs = {need for name in names for need in PUT[name].needs}
        lacking = needs - ({"time"} if log.timed else set())
        both = (True, False) if len(names) == 1 else (True,)
        for size in config.sizes:
            for recorded in both if lacking else (None,):
                yield Case(log.name, names, size, recorded)


def _course(duration: float, rng: np.random.Generator) -> Course:
    """A temperature that rises to a limit, or wanders."""
    time = np.linspace(0.0, duration, 60)
    if rng.random() < 0.5:
        slow = duration * rng.uniform(0.2, 1.0)
        return Course(time, 21 + rng.uniform(4, 15) * -np.expm1(-time / slow))
    turns, start = rng.uniform(0.4, 3.0, 3), rng.uniform(0, 2 * np.pi, 3)
    waves = np.sin(2 * np.pi * np.outer(time / duration, turns) + start)
    return Course(time, 24 + waves @ rng.uniform(1, 3, 3))


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
    def opened(cls, name: str, path: Path, settings: ImportSettings, interval: float,
               own: Sequence[str] = ()) -> Donor:
        """Read a log, and find its holds."""
        campaign, report = import_log(path, settings)
        spans = spans_of(campaign, report)
        if settings.means:
            forces, time = campaign.forces, interval * (np.arange(campaign.n_positions) + 0.5)
        else:
            rows = [*log_of(path, settings).chunks()]
            forces = np.concatenate([part.forces for part in rows])
            time = np.concatenate([part.time for part in rows])
        return cls(name, settings, forces, time, not settings.means, spans, tuple(own))

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

    def unit(self, effect: Effect, settings: Mapping[str, float], course: Course | None) -> Array:
        """What each parameter of an effect adds to the readings, (k, N, 3)."""
        assert effect.sensor is not None
        felt, time, each = self.felt, self.time, slice(None)
        if effect.name in BY_HOLD:
            felt, time, each = self.means(felt, self.spans), time[self.spans[:, 0]], self.hold_of
        session = Session(
            self.name, np.zeros((len(time), 2)), time, 1.0, 1.0, time=time, course=course
        )
        one = np.eye(effect.k)[:, None, :]
        return np.asarray(effect.sensor(felt[None], one, settings, session)[:, each])

    def write(self, path: Path, added: Array, columns: Mapping[str, Array]) -> ImportSettings:
        """Write the log with what is added to its readings; returns how it is imported."""
        given = self.settings
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


@dataclass(frozen=True)
class Put:
    """An effect that was put into a log.

    Attributes
    ----------
    effect : Effect
    settings : dict of str to float
    parameters : (k,) array
    """

    effect: Effect
    settings: dict[str, float]
    parameters: Array


def put(name: str, size: float, log: Donor, course: Course | None, rng: np.random.Generator) -> Put:
    """Draw an effect that has a noncentrality in a log.

    Raises
    ------
    InputError
        If the log cannot show it.
    """
    effect, atlas = PUT[name], log.atlas(log.spans, course, log.sigma)
    settings = effect.draw(atlas.session, rng)
    if "t" in settings:  # between two holds: what jumps within one is another effect
        between = (log.time[log.spans[:-1, 1] - 1] + log.time[log.spans[1:, 0]]) / 2
        settings["t"] = float(between[np.argmin(abs(between - settings["t"]))])
    left, shape = shape_of(log, log.spans, atlas, effect, settings)
    if shape is None:
        raise InputError(f"{log.name}: cannot show {name}")
    parameters = rng.standard_normal(effect.k)
    parameters = shape.directions @ (
        shape.directions.T @ (abs(parameters) if effect.loses else parameters)
    )
    return Put(effect, settings, parameters * np.sqrt(size / np.sum((parameters @ left) ** 2)))


def shape_of(
    log: Donor,
    spans: NDArray[np.int_],
    atlas: Atlas,
    effect: Effect,
    settings: Mapping[str, float],
) -> tuple[Array, Shape | None]:
    """What each parameter of an effect leaves in holds, (k, m), and the shape of that."""
    holds = log.means(log.unit(effect, settings, atlas.session.course), spans)
    left = atlas.conditions.left(atlas.conditions.changed(holds))
    size = np.sqrt(np.sum((holds / atlas.session.sigma) ** 2) / effect.k)
    return left, Shape.of(effect, settings, left, float(size))


def run_log(
    config: RealNoiseConfig, name: str, output: str | Path, provenance: Mapping[str, Any]
) -> None:
    """Put effects into a log, have each campaign diagnosed, and write truths and answers."""
    path, settings = public_file(name, config.public_folder), import_settings(name)
    log = Donor.opened(name, path, settings, config.interval_s, config.logs[name].own)
    rows = []
    for case in cases_of(config, log):
        row, error = tried(lambda case: _row(config, log, case), case, case.name)
        rows.append({**_named(case), "classes": "[]", **(row or {}), "error": error})
    write_table(output, table_of(rows, log.own), provenance)


def _named(case: Case) -> Row:
    """What a row begins with."""
    return {
        "cell": case.name,
        "campaign": case.number,
        "set": ("null", "one", "two")[len(case.effects)],
        "what": case.what,
        "size": case.size,
        "design": case.log,
        "approach": "gravity",
        "recorded": case.recorded,
        "gross_name": BUMPED if BUMPED in case.effects else "",
    }


def _row(config: RealNoiseConfig, log: Donor, case: Case) -> Row:
    """Put effects into a log, import and diagnose it; a row of truth and answer."""
    rng = case.rng(config.seed)
    course = None
    if any("course" in PUT[name].needs for name in case.effects) or not case.effects:
        course = _course(float(log.time[-1]), rng)
    puts = [put(name, case.size, log, course, rng) for name in case.effects]
    added = np.zeros(log.forces.shape)
    for one in puts:
        added += np.tensordot(one.parameters, log.unit(one.effect, one.settings, course), 1)
    columns: dict[str, Array] = {}
    if case.recorded and course is not None:
        columns["temperature"] = np.round(course.at(log.time), 1)
    if case.recorded and not log.timed:
        columns["time"] = log.time
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"{log.name}.parquet"
        campaign, report = import_log(path, log.write(path, added, columns))
    spans = spans_of(campaign, report)
    model = get_model(config.logs[log.name].model or config.model)
    verdict = judge(campaign, model, seed=config.diagnosis_seed)
    row = {**outcome(verdict), "sigma": "given" if campaign.sigma_force else "not given"}
    row["effects"] = json.dumps(
        [
            {"name": p.effect.name, "settings": p.settings, "parameters": p.parameters.tolist()}
            for p in puts
        ]
    )
    return row | _known(log, spans, course, puts, case, verdict) if puts else row


def _known(
    log: Donor,
    spans: NDArray[np.int_],
    course: Course | None,
    puts: Sequence[Put],
    case: Case,
    verdict: Verdict,
) -> Row:
    """What is right, and what is found by who knows the forms of the effects."""
    atlas = log.atlas(spans, course, log.sigma)
    forces, none = verdict.campaign.whole.forces, np.zeros((1, len(spans), 2))
    z = atlas.conditions.seen(forces[None], none)[0]
    lefts, shapes = zip(*(shape_of(log, spans, atlas, p.effect, p.settings) for p in puts))
    row: Row = {"p_known": 0.0}
    for i, (one, left, shape) in enumerate(zip(puts, lefts, shapes, strict=True)):
        others = [s.basis for k, s in enumerate(shapes) if k != i and s is not None]
        beside = np.concatenate([np.zeros((len(z), 0)), *others], axis=1)
        basis = np.linalg.qr(_without(shape.basis.T, beside).T)[0]
        rest = _without(z, beside)
        true = _without(one.parameters @ left, beside)
        d, redundancy = shape.dim, len(z) - 9 - beside.shape[1]
        redundancy -= EFFECTS[log.own[0]].k if log.own else 0
        gain, dof = float(np.sum((rest @ basis) ** 2)), redundancy - d
        unit_variance = (float(rest @ rest) - gain) / dof
        p = float(special.fdtrc(d, dof, gain / d / unit_variance))
        if p < row["p_known"]:
            continue
        size = float(true @ true)
        row |= {
            "p_known": p,
            "known_ratio": float(rest @ true) / size,
            "known_sigma": np.sqrt(unit_variance / size),
        }
        estimate = _estimated(log, spans, atlas, one.effect, verdict)
        if estimate is not None:
            parts, covariance = estimate[1] @ true / size, estimate[2]
            row |= {
                "ratio": float(estimate[0] @ parts),
                "ratio_sigma": float(np.sqrt(parts @ covariance @ parts)),
            }
    if case.effects[0] == BUMPED:
        first, last = log.spans[int(puts[0].settings["row"])]
        there = np.flatnonzero((spans[:, 0] < (first + last) / 2) & ((first + last) / 2 < spans[:, 1]))
        place = int(verdict.campaign.positions[there[0]]) if len(there) else None
        return row | {"gross": json.dumps({"settings": {"position": place}})}
    said = Oracle(atlas).judge(z, (case.size,) * len(puts))
    return row | {
        "classes": json.dumps([atlas.same_as(shape) for shape in shapes]),
        "oracle_detected": said.detected,
        "oracle_best": json.dumps(said.best),
        "oracle_told": json.dumps(said.told),
    }


def _without(rows: Array, basis: Array) -> Array:
    """Rows (..., m) less what they have in an orthonormal basis (m, d)."""
    return np.asarray(rows - (rows @ basis) @ basis.T)


def _estimated(
    log: Donor, spans: NDArray[np.int_], atlas: Atlas, effect: Effect, verdict: Verdict
) -> tuple[Array, Array, Array] | None:
    """Parameters (k,) of an effect as the diagnosis found them, what each leaves, covariance."""
    named = next((one for one in verdict.found if one.name == effect.name), None)
    if named is None or not named.parameters:
        return None
    found = next(one for one in verdict.extended.effects if one.name == effect.name)
    left, _ = shape_of(log, spans, atlas, effect, found.settings)
    # Some of its parameters may be zero, as the positions do not show them.
    names = [parameter.name for parameter in get_effect(effect.name).parameters]
    left = left[[names.index(name) for name, *_ in named.parameters]]
    columns = [verdict.extended.parameter_names.index(name) for name, *_ in named.parameters]
    covariance = verdict.final.solution.cofactors[np.ix_(columns, columns)] * verdict.unit_variance
    return np.array([value for _, value, *_ in named.parameters]), left, covariance


NUMBERS = ("p_known", "ratio", "ratio_sigma", "known_ratio", "known_sigma")
"""Columns beside those of the study of hidden effects: p-value of the F test that knows the form,
then size over true size and its sigma, by the diagnosis and by that test. Of two effects they are
those of the one that the test finds less certain."""
SAID = (
    "right name", "family or set", "other name", "noise", "unknown", "learned", "nothing",
    "no answer",
)  # fmt: skip
"""What may be said of what was put in."""


def table_of(rows: list[Row], own: Sequence[str]) -> pd.DataFrame:
    """Truths and answers side by side, judged by what was put in.

    Parameters
    ----------
    rows : of the columns of truths, outcomes and `NUMBERS`, and recorded
    own : names of what the log has by itself, which count neither as right nor as wrong
    """
    lists = ("found", "positions", "credible_set", "oracle_best", "oracle_told", "gross")
    columns = SCHEMA["truths"] | SCHEMA["outcomes"] | dict.fromkeys(NUMBERS, "float64")
    columns |= {"recorded": "boolean"}
    full = [{**dict.fromkeys(columns), **dict.fromkeys(lists, "[]"), **row} for row in rows]
    table = pd.DataFrame(full, columns=[*columns]).astype(columns)
    answers = judged(pd.DataFrame([_less(row, own) for row in table.to_dict("records")]))
    said = [said_of(row) for row in answers.to_dict("records")]
    new = answers[[name for name in answers if name not in table]]
    return pd.concat([table, new, pd.Series(said, name="said", dtype="string")], axis=1)


def _less(row: Row, own: Sequence[str]) -> Row:
    """An answer without what a log has by itself."""
    names, positions = json.loads(row["found"]), json.loads(row["positions"])
    kept = [(name, place) for name, place in zip(names, positions, strict=True) if name not in own]
    found = [name for name, _ in kept]
    explanations = [
        {**one, "names": [name for name in one["names"] if name not in own]}
        for one in json.loads(row["credible_set"])
    ]
    only = own and row["verdict"] in ("named", "narrowed") and not found
    return row | {
        "found": json.dumps(found),
        "positions": json.dumps([place for _, place in kept]),
        "verdict": "no_effect" if only else row["verdict"],
        "credible_set": json.dumps([one for one in explanations if one["names"]]),
    }


def said_of(row: Row) -> str:
    """What an answer says of what was put in, one of `SAID`."""
    if not row["ok"]:
        return "no answer"
    if row["right"] or row["recognised"] is True:
        return "right name"
    true, explanations = json.loads(row["classes"]), json.loads(row["credible_set"])
    certain = [
        sum(one["posterior"] for one in explanations if name in one["names"])
        for names in true
        for name in names
    ]
    held = row["verdict"] == "narrowed" and row["set_holds"] is True
    partly = row["verdict"] == "unknown" and max(certain, default=0.0) >= CREDIBLE
    if held or partly or row["one_of_two"]:
        return "family or set"
    if row["verdict"] in ("named", "narrowed", "gross_error"):
        families = [{name for each in names for name in _kin(each, row["recorded"])} for names in true]
        found = json.loads(row["found"])
        return "family or set" if families and all_true([[n] for n in found], families) else "other name"
    kinds = {"no_effect": "nothing", "noise_model": "noise"}
    return kinds.get(row["verdict"], row["verdict"])


def _kin(name: str, recorded: bool | None) -> tuple[str, ...]:
    """Effects of its family; without its column, what a temperature does is a slow change."""
    slow = family_of("warm_up") if name in family_of("thermal_bias") and recorded is False else ()
    return (*family_of(name), *slow)
