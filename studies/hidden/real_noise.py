"""The study with real noise: known effects in the readings of public logs have to be found again.

`studies.hidden.real_logs` puts them in. Import and diagnosis get the changed log, and the answer is
judged as in the study of hidden effects, of which a log is a design. Beside it stands what an F
test says that knows the form of the effect, and the oracle's best answer.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import ClassVar, Self

import numpy as np
from pydantic import Field, model_validator

from accelstudy.basics.errors import UnknownNameError
from accelstudy.campaign.importing.logs import import_log
from accelstudy.campaign.importing.public import import_settings, public_file
from accelstudy.campaign.session import Campaign
from accelstudy.config_names import ModelName
from accelstudy.files.validation import Block, OneOrMore, PathName, Positive, Replicates
from studies.hidden.physics.designs import Course
from studies.hidden.physics.generate import Case, HiddenEffect, Truth
from studies.hidden.physics.geometry import Array
from studies.hidden.physics.oracle import Oracle
from studies.hidden.real_logs import BUMPED, PUT, Donor, p_value, residuals, spans_of
from studies.hidden.study import Job, Study

FEWEST = 5
"""Redundancy of a log, below which nothing is put into it."""


class Log(Block):
    """A public log, and what is true of it as it is."""

    model: ModelName | None = Field(None, description="model, by default that of the study")
    own: list[str] = Field([], description="names of an effect that it has by itself, any of them")
    note: str = Field(description="what is true of it, as the score shall say")


class RealNoiseConfig(Study):
    """A study with real noise; results go to ``results/<study>``."""

    score: ClassVar = "real"

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

    @model_validator(mode="after")
    def _names_exist(self) -> Self:
        for name in self.logs:
            import_settings(name)
        for name in "+".join(self.effects).split("+"):
            if name not in PUT:
                raise ValueError(f"effects: {UnknownNameError('effect', name, PUT)}")
        return self

    @property
    def jobs(self) -> list[str]:
        """Names of the jobs, one for each log."""
        return [*self.logs]

    def job(self, name: str) -> Job:
        """Campaigns of a log."""
        path, settings = public_file(name, self.public_folder), import_settings(name)
        return self.of_log(Donor(name, path, settings, self.interval_s, self.logs[name].own))

    def of_log(self, log: Donor) -> Job:
        """Campaigns of a log that is open."""
        return Job(
            self.log_cases(log),
            lambda case, k: changed_log(log, case, case.seed(self.seed, k)),
            self.logs[log.name].model or self.model,
            self.diagnosis_seed,
        )

    def log_cases(self, log: Donor) -> Iterator[tuple[LogCase, int]]:
        """All campaigns of a log; beside an effect of its own, single ones of other names."""
        for number in range(self.nothing):
            yield LogCase("null", log.name, recorded=True if number else None), number
        for effects in self.effects if log.redundancy >= FEWEST else ():
            names = tuple(effects.split("+"))
            if log.own and (len(names) > 1 or names[0] in log.own):
                continue
            lacking = {need for name in names for need in PUT[name].needs}
            lacking -= {"time"} if log.timed else set()
            both = (True, False) if len(names) == 1 else (True,)
            for size in self.sizes:
                for recorded in both if lacking else (None,):
                    set_ = "one" if len(names) == 1 else "two"
                    lam = (size,) * len(names)
                    yield LogCase(set_, log.name, effect=names, lam=lam, recorded=recorded), 0


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
    rng, course, columns = np.random.default_rng(seed), None, dict[str, Array]()
    if any("temperature" in PUT[name].needs for name in case.effect) or not case.effect:
        course = _course(float(log.time[-1]), rng)
    sizes = [*zip(case.effect, case.lam, strict=True)]
    causes = [log.drawn(name, lam, course, rng) for name, lam in sizes]
    if case.recorded and course is not None:
        columns["temperature"] = np.round(course.at(log.time), 1)
    if case.recorded and not log.timed:
        columns["time"] = log.time
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"{log.name}.parquet"
        campaign, holds = import_log(path, log.write(path, causes, course, columns))
    spans = spans_of(campaign, holds)
    truth = Truth(tuple(map(HiddenEffect.of, causes, case.lam)))
    if not causes:
        return campaign, truth
    atlas = log.atlas(spans, course, log.sigma)
    shapes = [log.shape(one.kind, one.settings, atlas, spans)[1] for one in causes]
    z = residuals(atlas, campaign.forces)
    truth = replace(truth, p_known=p_value(log, z, shapes, len(spans)))
    if BUMPED in case.effect:
        # The hold in which the bumped one lies, whatever its number became.
        middle = np.mean(log.spans[int(causes[0].settings["row"])])
        place = campaign.positions[(spans[:, 0] <= middle) & (middle < spans[:, 1])].tolist()
        gross = {"name": BUMPED, "settings": {"position": place[0] if place else None}}
        truth = replace(truth, gross=gross)
    else:
        said = Oracle(atlas).judge(z, case.lam)
        truth = replace(truth, classes=tuple(map(atlas.same_as, shapes)), oracle=said)
    return campaign, truth


def _course(duration: float, rng: np.random.Generator) -> Course:
    """A temperature that rises to a limit, or wanders."""
    time = np.linspace(0.0, duration, 60)
    if rng.random() < 0.5:
        slow = duration * rng.uniform(0.2, 1.0)
        return Course(time, 21 + rng.uniform(4, 15) * -np.expm1(-time / slow))
    turns, start = rng.uniform(0.4, 3.0, 3), rng.uniform(0, 2 * np.pi, 3)
    waves = np.sin(2 * np.pi * np.outer(time / duration, turns) + start)
    return Course(time, 24 + waves @ rng.uniform(1, 3, 3))
