"""The study with real noise: known effects in the readings of public logs have to be found again.

`studies.hidden.real_logs` puts them in. Import and diagnosis get the changed log, and the answer
is judged as in the study of hidden effects. Beside it stands what an F test says that knows the
form of the effect, and the oracle's best answer.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from pydantic import Field
from scipy import special

from accelstudy.basics.errors import InputError, UnknownNameError
from accelstudy.campaign.importing.logs import import_log
from accelstudy.campaign.importing.public import import_settings, public_file
from accelstudy.config_names import ModelName
from accelstudy.diagnosis.pipeline import judge
from accelstudy.diagnosis.result import Verdict
from accelstudy.effects import get_effect
from accelstudy.files.reading import config_hash
from accelstudy.files.tables import write_table
from accelstudy.files.validation import (
    Block,
    OneOrMore,
    PathName,
    Positive,
    Replicates,
    Seed,
    checked,
)
from accelstudy.sensors.models import get_model
from studies.hidden.campaigns import SCHEMA, Row, tried
from studies.hidden.cells import family_of
from studies.hidden.diagnosing import outcome
from studies.hidden.judging import EFFECTS_GIVEN, all_true
from studies.hidden.judging import judge as judged
from studies.hidden.physics.designs import Course
from studies.hidden.physics.oracle import CREDIBLE, Oracle
from studies.hidden.real_logs import BUMPED, PUT, Donor, Shown, put, shown, spans_of

Array = NDArray[np.float64]

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
        # Not of the columns: with and without them it is the same session.
        what = f"{self.log}/{self.what}/{self.size:g}"
        words = [seed, zlib.crc32(what.encode()), self.number]
        return np.random.default_rng(np.random.SeedSequence(words))


def cases_of(config: RealNoiseConfig, log: Donor) -> Iterator[Case]:
    """All that is put into a log; beside an effect of its own, single ones of other names."""
    for number in range(config.nothing):
        yield Case(log.name, recorded=True if number else None, number=number)
    for effects in config.effects if log.redundancy >= FEWEST else ():
        names = tuple(effects.split("+"))
        if log.own and (len(names) > 1 or names[0] in log.own):
            continue
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


def run_log(
    config: RealNoiseConfig, name: str, output: str | Path, provenance: Mapping[str, Any]
) -> None:
    """Put effects into a log, have each campaign diagnosed, and write truths and answers."""
    path, settings = public_file(name, config.public_folder), import_settings(name)
    log = Donor.opened(name, path, settings, config.interval_s, config.logs[name].own)
    rows = []
    for case in cases_of(config, log):
        row, error = tried(lambda case: answered(config, log, case), case, case.name)
        rows.append(row or {**_named(case), "error": error})
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
        "classes": "[]",
        "gross_name": "",
    }


def answered(config: RealNoiseConfig, log: Donor, case: Case) -> Row:
    """Put effects into a log, import and diagnose it; a row of truth and answer."""
    rng, course = case.rng(config.seed), None
    if any("course" in PUT[name].needs for name in case.effects) or not case.effects:
        course = _course(float(log.time[-1]), rng)
    puts = [put(name, case.size, log, course, rng) for name in case.effects]
    columns: dict[str, Array] = {}
    if case.recorded and course is not None:
        columns["temperature"] = np.round(course.at(log.time), 1)
    if case.recorded and not log.timed:
        columns["time"] = log.time
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"{log.name}.parquet"
        campaign, report = import_log(path, log.write(path, puts, course, columns))
    model = get_model(config.logs[log.name].model or config.model)
    spans = spans_of(campaign, report)
    row: Row = {
        **_named(case),
        "sigma": "given" if campaign.sigma_force else "not given",
        "effects": json.dumps([one.to_dict() for one in puts]),
    }
    seen = shown(log, spans, course, puts, campaign.forces)
    if puts:
        row |= _known(seen) | _named_by_oracle(seen, case)
    if BUMPED in case.effects:
        # The hold in which the bumped one lies, whatever its number became.
        middle = np.mean(log.spans[int(puts[0].settings["row"])])
        place = campaign.positions[(spans[:, 0] <= middle) & (middle < spans[:, 1])]
        row["gross"] = json.dumps({"settings": {"position": int(place[0]) if len(place) else None}})

    def answer(_: Any) -> Row:
        verdict = judge(campaign, model, seed=config.diagnosis_seed)
        return outcome(verdict) | _sizes(log, seen, verdict)

    answers, error = tried(answer, campaign, case.name)
    return row | (answers or {}) | {"error": error}


NUMBERS = ("p_known", "known_ratio", "known_sigma", "ratio", "ratio_sigma")
"""Columns beside those of the study of hidden effects: p-value of the F test that knows the form;
size over true size and its sigma, by that test and by the diagnosis. Of two effects p-value and
sizes are those of the one that is less certain."""


def _known(seen: Sequence[Shown]) -> Row:
    """What the F test says that knows the form, of the effect that is less certain."""
    tests = []
    for one in seen:
        gain = float(np.sum((one.z @ one.basis) ** 2))
        dof = one.redundancy - one.basis.shape[1]
        variance = (float(one.z @ one.z) - gain) / dof
        p = float(special.fdtrc(one.basis.shape[1], dof, gain / one.basis.shape[1] / variance))
        size = float(one.true @ one.true)
        ratio = float(one.z @ one.true) / size
        tests.append((p, ratio, float(np.sqrt(variance / size))))
    return dict(zip(NUMBERS, max(tests), strict=False))


def _named_by_oracle(seen: Sequence[Shown], case: Case) -> Row:
    """Names that are right, and what the oracle says; it knows no bumped holds."""
    if BUMPED in case.effects:
        return {"gross_name": BUMPED}
    atlas = seen[0].atlas
    said = Oracle(atlas).judge(seen[0].whole, (case.size,) * len(seen))
    return {
        "classes": json.dumps([atlas.same_as(one.shape) for one in seen]),
        "oracle_detected": said.detected,
        "oracle_best": json.dumps(said.best),
        "oracle_told": json.dumps(said.told),
    }


def _sizes(log: Donor, seen: Sequence[Shown], verdict: Verdict) -> Row:
    """Size of an effect as the diagnosis found it over the true size, the least certain one."""
    sizes = []
    for one in seen:
        name = one.put.effect.name
        named = next((found for found in verdict.found if found.name == name), None)
        if named is None or not named.parameters:
            continue
        found = next(each for each in verdict.extended.effects if each.name == name)
        # Some of its parameters may be zero, as the positions do not show them.
        names = [parameter.name for parameter in get_effect(name).parameters]
        rows = [names.index(parameter) for parameter, *_ in named.parameters]
        left = one.left_by(log, found.settings)[rows] @ one.true / float(one.true @ one.true)
        columns = [verdict.extended.parameter_names.index(names[row]) for row in rows]
        covariance = verdict.final.solution.cofactors[np.ix_(columns, columns)]
        sigma = float(np.sqrt(left @ covariance @ left * verdict.unit_variance))
        sizes.append((sigma, float(np.array([p[1] for p in named.parameters]) @ left)))
    if not sizes:
        return {}
    sigma, ratio = max(sizes)
    return {"ratio": ratio, "ratio_sigma": sigma}


def table_of(rows: list[Row], own: Sequence[str]) -> pd.DataFrame:
    """Truths and answers side by side, judged by what was put in.

    Parameters
    ----------
    rows : of `answered`
    own : names of what the log has by itself, which count neither as right nor as wrong
    """
    lists = ("found", "positions", "credible_set", "oracle_best", "oracle_told", "gross")
    columns = SCHEMA["truths"] | SCHEMA["outcomes"] | dict.fromkeys(NUMBERS, "float64")
    columns |= {"recorded": "boolean"}
    full = [{**dict.fromkeys(columns), **dict.fromkeys(lists, "[]"), **row} for row in rows]
    table = pd.DataFrame(full, columns=[*columns]).astype(columns)
    given: list[Any] = table.to_dict("records")
    answers = judged(pd.DataFrame([_less(row, own) for row in given]))
    told: list[Any] = answers.to_dict("records")
    said = [said_of(row) for row in told]
    new = answers[[name for name in answers if name not in table]]
    return pd.concat([table, new, pd.Series(said, name="said", dtype="string")], axis=1)


def _less(row: Row, own: Sequence[str]) -> Row:
    """An answer without what a log has by itself."""
    names, positions = json.loads(row["found"]), json.loads(row["positions"])
    kept = [(name, place) for name, place in zip(names, positions, strict=True) if name not in own]
    explanations = [
        {**one, "names": [name for name in one["names"] if name not in own]}
        for one in json.loads(row["credible_set"])
    ]
    only = own and row["verdict"] in EFFECTS_GIVEN and not kept
    return row | {
        "found": json.dumps([name for name, _ in kept]),
        "positions": json.dumps([place for _, place in kept]),
        "verdict": "no_effect" if only else row["verdict"],
        "credible_set": json.dumps([one for one in explanations if one["names"]]),
        "fits": None,
    }


RIGHT, NEAR, OTHER, NONE = "right name", "family or set", "other name", "no answer"
SAID = (RIGHT, NEAR, OTHER, "noise", "unknown", "learned", "nothing", NONE)
"""What may be said of what was put in."""


def said_of(row: Row) -> str:
    """What an answer says of what was put in, one of `SAID`.

    "family or set": of two effects one; a set that holds the right names; other names of the same
    families; or a verdict "unknown" that leaves no doubt of such a family. Without its column, what
    a temperature does is a slow change in time.
    """
    if not row["ok"]:
        return NONE
    if row["right"] or row["recognised"] is True:
        return RIGHT
    families = [
        [kin for name in names for kin in _kin(name, row["recorded"])]
        for names in json.loads(row["classes"])
    ]
    if row["one_of_two"] or (row["verdict"] == "narrowed" and row["set_holds"] is True):
        return NEAR
    if row["verdict"] in (*EFFECTS_GIVEN, "gross_error"):
        found = [[name] for name in json.loads(row["found"])]
        return NEAR if families and all_true(found, families) else OTHER
    explanations = json.loads(row["credible_set"])
    certain = [
        sum(one["posterior"] for one in explanations if set(one["names"]) & set(family))
        for family in families
    ]
    if row["verdict"] == "unknown" and max(certain, default=0.0) >= CREDIBLE:
        return NEAR
    verdict = str(row["verdict"])
    return {"no_effect": "nothing", "noise_model": "noise"}.get(verdict, verdict)


def _kin(name: str, recorded: bool | None) -> tuple[str, ...]:
    """Effects of the family of one, and of what it is where its column is missing."""
    missing = recorded is False and name in family_of("thermal_bias")
    return (*family_of(name), *(family_of("warm_up") if missing else ()))
