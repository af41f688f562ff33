"""The study with real noise: known effects in the readings of public logs have to be found again.

`studies.hidden.real_logs` puts them in. Import and diagnosis get the changed log, and the answer is
judged as in the study of hidden effects, of which a log is a design. Beside it stands what an F
test says that knows the form of the effect, and the oracle's best answer.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from pydantic import Field

from accelstudy.basics.errors import InputError, UnknownNameError
from accelstudy.campaign.importing.logs import import_log
from accelstudy.campaign.importing.public import import_settings, public_file
from accelstudy.config_names import ModelName
from accelstudy.diagnosis.result import Verdict
from accelstudy.effects import get_effect
from accelstudy.files.tables import write_table
from accelstudy.files.validation import Block, OneOrMore, PathName, Positive, Replicates, checked
from studies.hidden.campaigns import SCHEMA, Made, Row, rows_table
from studies.hidden.cells import Cell
from studies.hidden.config import Study
from studies.hidden.diagnosing import diagnosed
from studies.hidden.physics.designs import Course
from studies.hidden.physics.generate import Case, HiddenEffect, Truth
from studies.hidden.physics.oracle import Oracle
from studies.hidden.real_logs import BUMPED, PUT, Donor, Shown, put, seen, shown, spans_of

Array = NDArray[np.float64]

FEWEST = 5
"""Redundancy of a log, below which nothing is put into it."""
SIZES = ("p_known", "known_ratio", "known_sigma", "ratio", "ratio_sigma")
"""p-value of the F test that knows the form; size over true size and its sigma, by that test and by
the diagnosis. Of two effects they are those of the one that is less certain."""
LOG_SCHEMA = {**SCHEMA["truths"], **SCHEMA["outcomes"], **dict.fromkeys(SIZES, "float64"),
              "recorded": "boolean"}  # fmt: skip
"""Columns of the table of a log: a row of truth and answer each."""


class Log(Block):
    """A public log, and what is true of it as it is."""

    model: ModelName | None = Field(None, description="model, by default that of the study")
    own: list[str] = Field([], description="names of an effect that it has by itself, any of them")
    note: str = Field(description="what is true of it, as the score shall say")


class RealNoiseConfig(Study):
    """A study with real noise; results go to ``results/<study>``."""

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

    def model_of(self, log: str) -> str:
        """Model with which a log is diagnosed."""
        return self.logs[log].model or self.model


def parse_real_noise(content: Mapping[str, Any], source: str = "config") -> RealNoiseConfig:
    """As `parse_hidden`, of a study with real noise."""
    config = checked(RealNoiseConfig, content, source)
    for name in config.logs:
        import_settings(name)
    for name in {one for each in config.effects for one in each.split("+")}:
        if name not in PUT:
            raise InputError(f"{source}: effects: {UnknownNameError('effect', name, PUT)}")
    return config


@dataclass(frozen=True)
class LogCell(Cell):
    """Campaigns of a log.

    Attributes
    ----------
    recorded : bool, whether the columns on which effects depend are there; None if they need none
    """

    recorded: bool | None = None

    @property
    def name(self) -> str:
        """Name, unique within a study."""
        columns = {None: "as it is", True: "recorded", False: "not recorded"}[self.recorded]
        return f"{self.case.design}/{self.what or 'nothing'}/{self.size:g}/{columns}"

    def seed(self, seed: int, campaign: int) -> np.random.SeedSequence:
        """Seed of a campaign: with and without its columns it is the same session."""
        what = f"{self.case.design}/{self.what or 'nothing'}/{self.size:g}"
        return np.random.SeedSequence([seed, zlib.crc32(what.encode()), campaign])


def log_cells(config: RealNoiseConfig, log: Donor) -> Iterator[tuple[LogCell, int]]:
    """All campaigns of a log; beside an effect of its own, single ones of other names."""
    for number in range(config.nothing):
        null = Case("null", log.name, "gravity", sigma_known=False)
        yield LogCell(null, recorded=True if number else None), number
    for effects in config.effects if log.redundancy >= FEWEST else ():
        names = tuple(effects.split("+"))
        if log.own and (len(names) > 1 or names[0] in log.own):
            continue
        there = {"time"} if log.timed else set()
        lacking = {need for name in names for need in PUT[name].needs} - there
        both = (True, False) if len(names) == 1 else (True,)
        for size in config.sizes:
            set_ = "one" if len(names) == 1 else "two"
            case = Case(set_, log.name, "gravity", False, names, (size,) * len(names))
            for recorded in both if lacking else (None,):
                yield LogCell(case, recorded=recorded), 0


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
    write_table(output, log_table(config, log, log_cells(config, log)), provenance)


def log_table(
    config: RealNoiseConfig, log: Donor, campaigns: Iterable[tuple[LogCell, int]]
) -> pd.DataFrame:
    """Truths and answers of campaigns of a log, side by side."""

    def make(cell: LogCell, k: int) -> Made:
        return changed_log(config.seed, log, cell, k)

    rows = diagnosed(campaigns, make, config.model_of(log.name), config.diagnosis_seed)
    return rows_table(({**truth, **answer} for truth, answer, _ in rows), LOG_SCHEMA)


def changed_log(seed: int, log: Donor, cell: LogCell, k: int) -> Made:
    """Put effects into a log, and import it."""
    case, rng, course = cell.case, np.random.default_rng(cell.seed(seed, k)), None
    if any("course" in PUT[name].needs for name in case.effect) or not case.effect:
        course = _course(float(log.time[-1]), rng)
    causes = [
        put(name, lam, log, course, rng) for name, lam in zip(case.effect, case.lam, strict=True)
    ]
    columns: dict[str, Array] = {}
    if cell.recorded and course is not None:
        columns["temperature"] = np.round(course.at(log.time), 1)
    if cell.recorded and not log.timed:
        columns["time"] = log.time
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"{log.name}.parquet"
        campaign, report = import_log(path, log.write(path, causes, course, columns))
    spans = spans_of(campaign, report)
    found = shown(log, spans, course, causes, campaign.forces)
    truth = Truth(
        effects=tuple(
            HiddenEffect(one.kind.name, one.settings, tuple(one.parameters[0].tolist()), lam)
            for one, lam in zip(causes, case.lam, strict=True)
        )
    )
    if BUMPED in case.effect:
        # The hold in which the bumped one lies, whatever its number became.
        middle = np.mean(log.spans[int(causes[0].settings["row"])])
        place = campaign.positions[(spans[:, 0] <= middle) & (middle < spans[:, 1])].tolist()
        gross = {"name": BUMPED, "settings": {"position": place[0] if place else None}}
        truth = replace(truth, gross=gross)
    elif found:
        atlas = found[0].atlas
        said = Oracle(atlas).judge(found[0].whole, case.lam)
        classes = tuple(atlas.same_as(one.shape) for one in found)
        truth = replace(truth, classes=classes, oracle=said)
    row: Row = {
        "sigma": "given" if campaign.sigma_force else "not given",
        "recorded": cell.recorded,
    }
    if found:
        row |= dict(zip(SIZES, max(one.f_test() for one in found), strict=False))
    return Made(campaign, truth, row, lambda verdict: _sizes(log, found, verdict))


def _sizes(log: Donor, found: Sequence[Shown], verdict: Verdict) -> Row:
    """Size of an effect as the diagnosis found it over the true size, the least certain one."""
    sizes = []
    for one in found:
        name = one.cause.kind.name
        named = next((each for each in verdict.found if each.name == name), None)
        if named is None or not named.parameters:
            continue
        settings = next(each for each in verdict.extended.effects if each.name == name).settings
        # Some of its parameters may be zero, as the positions do not show them.
        names = [parameter.name for parameter in get_effect(name).parameters]
        rows = [names.index(parameter) for parameter, *_ in named.parameters]
        left = seen(log, one.spans, one.atlas, one.cause.kind, settings)[0][rows]
        part = left @ one.true / float(one.true @ one.true)
        columns = [verdict.extended.parameter_names.index(names[row]) for row in rows]
        covariance = verdict.final.solution.cofactors[np.ix_(columns, columns)]
        sigma = float(np.sqrt(part @ covariance @ part * verdict.unit_variance))
        sizes.append((sigma, float(np.array([p[1] for p in named.parameters]) @ part)))
    return dict(zip(("ratio_sigma", "ratio"), max(sizes, default=()), strict=False))
