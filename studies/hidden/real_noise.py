"""The study with real noise: known effects in the readings of public logs have to be found again.

`studies.hidden.real_logs` puts them in. Import and diagnosis get the changed log, and the answer is
judged as in the study of hidden effects, of which a log is a design. Beside it stands what an F
test says that knows the form of the effect, and the oracle's best answer.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar, Self

from pydantic import Field, PrivateAttr, model_validator

from accelstudy.basics.errors import UnknownNameError
from accelstudy.campaign.importing.public import import_settings, public_file
from accelstudy.campaign.session import Campaign
from accelstudy.config_names import ModelName
from accelstudy.files.validation import ConfigSection, OneOrMore, PathName, Positive, Replicates
from studies.hidden.physics.generate import Truth
from studies.hidden.real_logs import PUT, Donor, LogCase, changed_log
from studies.hidden.study import Study

FEWEST = 5  # redundancy of a log, below which nothing is put into it


class Log(ConfigSection):
    """A public log, and what is true of it as it is.

    Attributes
    ----------
    model : model, by default that of the study
    own : names of an effect that it has by itself, any of them
    note : what is true of it, as the score shall say
    """

    model: ModelName | None = None
    own: list[str] = Field([])
    note: str


class RealNoiseConfig(Study):
    """A study with real noise; results go to ``results/<study>``.

    Attributes
    ----------
    public_folder : where the logs are, or are downloaded to
    interval_s : from one position to the next, where a log has no time
    logs : public data by name
    sizes : noncentralities λ
    effects : what is put in: one effect, or two as a+b
    nothing : campaigns of each log into which nothing is put: the first as the log is, the
        others with a temperature (and a time) recorded that does nothing
    """

    score: ClassVar = "real"
    baselines_every: ClassVar = 0

    public_folder: str = "resources/public"
    interval_s: Positive = 30.0
    logs: dict[PathName, Log] = Field(min_length=1)
    sizes: OneOrMore[Positive]
    effects: OneOrMore[str]
    nothing: Replicates

    _opened: dict[str, Donor] = PrivateAttr(default_factory=dict)

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

    def job(self, name: str) -> Iterator[tuple[LogCase, int]]:
        """All campaigns of a log; beside an effect of its own, single ones of other names."""
        log = self.opened(name)
        for number in range(self.nothing):
            yield LogCase("null", name, recorded=True if number else None), number
        for effects in self.effects if log.redundancy >= FEWEST else ():
            names = tuple(effects.split("+"))
            if log.own and (len(names) > 1 or names[0] in log.own):
                continue
            set_, both = ("one", (True, False)) if len(names) == 1 else ("two", (True,))
            lacking = {need for name in names for need in PUT[name].needs}
            lacking -= {"time"} if log.timed else set()
            for size in self.sizes:
                for recorded in both if lacking else (None,):
                    lam = (size,) * len(names)
                    yield LogCase(set_, name, effect=names, lam=lam, recorded=recorded), 0

    def make(self, case: LogCase, k: int) -> tuple[Campaign, Truth]:
        """Make a campaign of a log."""
        return changed_log(self.opened(case.design), case, case.seed(self.seed, k))

    def opened(self, name: str) -> Donor:
        """Open a log, once."""
        if name not in self._opened:
            path, settings = public_file(name, self.public_folder), import_settings(name)
            own = self.logs[name].own
            self._opened[name] = Donor(name, path, settings, self.interval_s, own)
        return self._opened[name]
