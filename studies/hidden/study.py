"""The study of hidden effects: its configuration, and the campaigns that this means.

A campaign has a case and a number. The campaigns of a kind and size are spread over all sessions
that can show it.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from functools import cache
from itertools import combinations, product
from math import ceil
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import Field, model_validator

from accelstudy.basics.bounds import Range
from accelstudy.basics.errors import InputError, UnknownNameError
from accelstudy.campaign.session import Campaign
from accelstudy.config_names import KnownModel
from accelstudy.effects import effect_names, get_effect
from accelstudy.files.reading import config_hash
from accelstudy.files.validation import (
    ConfigSection,
    OneOrMore,
    PathName,
    Positive,
    Replicates,
    Seed,
)
from studies.hidden.physics.designs import APPROACHES, DESIGNS
from studies.hidden.physics.generate import Case, Truth, generate
from studies.hidden.physics.gross import GROSS, visible_gross
from studies.hidden.physics.kinds import EFFECTS, OUTSIDE, UNFORESEEN
from studies.hidden.physics.measuring import NOISES
from studies.hidden.physics.oracle import oracle, visible_outside

Session = tuple[str, str, bool]  # design, approach and whether sigma is given
Numbered = tuple[Case, int]  # a case, and the number of the campaign among those of the case

CAMPAIGNS = Range(1, 1_000_000)  # of a study; the most take days of computing
JOB = 1600
"""Campaigns in one job: minutes of work, so that it does not matter that each job starts Python and
looks which session can show what."""


@cache
def distinct_pairs(design: str, approach: str) -> tuple[tuple[str, str], ...]:
    """All two effects that a session can show, and that do not mean the same in it."""
    seen = oracle(design, approach)
    alike: dict[str, set[str]] = {name: set() for name in seen.visible}
    for shape in seen.shapes:
        alike[shape.effect.name].update(seen.same_as(shape))
    return tuple(pair for pair in combinations(seen.visible, 2) if pair[1] not in alike[pair[0]])


TRIPLES, SIMILAR = 60, 0.8
"""Sets of three effects of a session, and the canonical cosine of two that are not similar."""


@cache
def distinct_triples(design: str, approach: str) -> tuple[tuple[str, str, str], ...]:
    """Sets of three effects, all over those that a session can show and easily distinguish."""
    seen = oracle(design, approach)
    cosines = dict(zip(combinations(seen.visible, 2), seen.pairs.cosines, strict=True))
    triples = [
        names
        for names in combinations(seen.visible, 3)
        if all(cosines[pair] < SIMILAR for pair in combinations(names, 2))
    ]
    return tuple(triples[:: len(triples) // TRIPLES + 1])


KINDS: Mapping[str, tuple[Collection[str], Callable[[str, str], Collection[str]]]] = {
    "noise": (NOISES, lambda *session: NOISES),
    "one": (EFFECTS, lambda *session: oracle(*session).visible),
    "removed": (EFFECTS, lambda *session: oracle(*session).visible),
    "outside": (OUTSIDE, visible_outside),
    "unforeseen": (UNFORESEEN, visible_outside),
    "gross": (GROSS, visible_gross),
    "invisible": (EFFECTS, lambda *session: oracle(*session).invisible),
}
"""Kinds that each set may have, and those that make sense in a design by an approach."""
SEVERAL = {"two": distinct_pairs, "three": distinct_triples}
SETS = ("nothing", *KINDS, *SEVERAL)  # blocks of campaigns


Row = dict[str, Any]


class NullCampaigns(ConfigSection):
    """Campaigns in which nothing is missing.

    Attributes
    ----------
    campaigns : in all
    """

    campaigns: Replicates


class Kinds(ConfigSection):
    """Campaigns with one thing each that has no size: wrong noise, gross or invisible.

    Attributes
    ----------
    kinds : names, or all
    campaigns : of each kind
    """

    kinds: OneOrMore[str] = Field(["all"])
    campaigns: Replicates


class SizedEffects(ConfigSection):
    """Campaigns with one thing each, in several sizes.

    Attributes
    ----------
    kinds : names, or all
    sizes : noncentralities λ
    campaigns : of each kind and size
    """

    kinds: OneOrMore[str] = Field(["all"])
    sizes: OneOrMore[Positive]
    campaigns: Replicates


class EffectSets(ConfigSection):
    """Campaigns with two or three effects each.

    Attributes
    ----------
    sizes : noncentralities λ, of each effect
    campaigns : of each size, each with effects at random
    """

    sizes: OneOrMore[Positive]
    campaigns: Replicates


class Study(ConfigSection):
    """What both studies have: which campaigns they make, how, and how they are diagnosed.

    Attributes
    ----------
    study : name; results go to results/<study>/
    seed : of all that is random
    model : model that is diagnosed
    diagnosis_seed : of each diagnosis, as the option --seed
    """

    study: PathName
    seed: Seed
    model: KnownModel = "bias-scale-nonorthogonality"
    diagnosis_seed: Seed = 1

    @property
    def fingerprint(self) -> str:
        """Hash of all that the numbers depend on, defaults included."""
        return config_hash(self.model_dump(mode="json", exclude={"public_folder"}))


class HiddenConfig(Study):
    """A study of hidden effects; results go to ``results/<study>``.

    Attributes
    ----------
    designs : sessions that are simulated, or all
    approaches : gravity, robot, or all
    sigma : whether a campaign says how large its noise is
    baselines_every : of each kind and size every so many campaigns get to the simpler methods
    nothing : nothing is missing
    noise : only the noise is not as it is said to be
    one : one effect of the catalogue
    two : two effects of the catalogue
    three : three that are easily distinguished
    removed : one effect whose family the diagnosis does not know
    outside : physics that was never in the catalogue
    unforeseen : the same, invented when what can be learned was fixed
    gross : gross errors
    invisible : effects that the session cannot show
    """

    score: ClassVar = "score"
    logs: ClassVar[Mapping[str, Any]] = {}

    designs: OneOrMore[str] = Field(["all"])
    approaches: OneOrMore[str] = Field(["all"])
    sigma: OneOrMore[Literal["given", "not given"]] = Field(default=["given", "not given"])
    baselines_every: Annotated[int, Field(ge=1)] = 20
    nothing: NullCampaigns | None = None
    noise: Kinds | None = None
    one: SizedEffects | None = None
    two: EffectSets | None = None
    three: EffectSets | None = None
    removed: SizedEffects | None = None
    outside: SizedEffects | None = None
    unforeseen: SizedEffects | None = None
    gross: Kinds | None = None
    invisible: Kinds | None = None

    @model_validator(mode="after")
    def _names_exist(self) -> Self:
        _known("designs", "design", self.designs, DESIGNS)
        _known("approaches", "approach", self.approaches, APPROACHES)
        for set_, (kinds, _) in KINDS.items():
            if block := getattr(self, set_):
                _known(f"{set_}.kinds", "kind", block.kinds, kinds)
        if not self.most:
            raise InputError(f"no campaigns; give at least one of {', '.join(SETS)}")
        CAMPAIGNS.check_key("campaigns in all", self.most)
        return self

    @property
    def places(self) -> list[Session]:
        """Combinations of design, approach and whether sigma is given."""
        designs = DESIGNS if self.designs == ["all"] else self.designs
        approaches = APPROACHES if self.approaches == ["all"] else self.approaches
        given = [one == "given" for one in self.sigma]
        return [*product(designs, approaches, given)]

    @property
    def most(self) -> int:
        """Number of campaigns, at most: fewer where no session can show a kind."""
        return sum(count for *_, count in self._wanted())

    @property
    def jobs(self) -> list[str]:
        """Names of the jobs among which the campaigns are divided."""
        return [f"{i:04d}" for i in range(ceil(self.most / JOB))]

    def campaigns(self) -> list[Numbered]:
        """All campaigns, in an order in which those of one session follow each other.

        Raises
        ------
        InputError
            If no session of the study can show a kind that the configuration names.
        """
        numbered, places = list[Numbered](), self.places
        for name, kind, size, count in self._wanted():
            cases = [case for place in places for case in _cases(name, kind, size, place)]
            if not cases and kind and getattr(self, name).kinds != ["all"]:
                raise InputError(f"{name}.kinds: no session of the study can show {kind}")
            # Which cases get one more is as good as random.
            each, more = divmod(count, max(len(cases), 1))
            for i, case in enumerate(sorted(cases, key=Case.digest)):
                numbered += [(case, k) for k in range(each + (i < more))]

        def session(one: Numbered) -> tuple[tuple[str, ...], int]:
            case = one[0]
            return removed(case), places.index((case.design, case.approach, case.sigma_known))

        return sorted(numbered, key=session)

    def job(self, name: str) -> list[Numbered]:
        """Campaigns of a job by its name: a part of all of them."""
        start = JOB * int(name)
        return self.campaigns()[start : start + JOB]

    def make(self, case: Case, k: int) -> tuple[Campaign, Truth]:
        """Make a campaign by the physics of the study."""
        return generate(case, case.seed(self.seed, k))

    def _wanted(self) -> Iterator[tuple[str, str, float | None, int]]:
        """Block, kind, size and number of the campaigns that are wanted."""
        for name, block in ((name, getattr(self, name)) for name in SETS if getattr(self, name)):
            kinds = getattr(block, "kinds", [""])
            for kind in KINDS[name][0] if kinds == ["all"] else kinds:
                for size in getattr(block, "sizes", [None]):
                    yield name, kind, size, block.campaigns


def _cases(name: str, kind: str, size: float | None, session: Session) -> Iterator[Case]:
    """Cases of a block, kind and size, in a session that can show what is hidden."""
    if name == "nothing":
        yield Case("null", *session)
    elif name in SEVERAL or kind in KINDS[name][1](*session[:2]):
        for effect in SEVERAL[name](*session[:2]) if name in SEVERAL else [(kind,)]:
            lam = () if size is None else (size,) * len(effect)
            hidden = {name: kind} if name in ("noise", "gross") else {"effect": effect, "lam": lam}
            yield Case(name, *session, **hidden)


@cache
def family_of(name: str) -> tuple[str, ...]:
    """Effects of the family of an effect, itself included."""
    family = get_effect(name).family
    return tuple(one for one in effect_names() if get_effect(one).family == family)


def removed(case: Case) -> tuple[str, ...]:
    """Effects that the diagnosis does not know: those of the family of what is hidden."""
    return family_of(case.effect[0]) if case.set == "removed" else ()


def _known(key: str, kind: str, names: Sequence[str], choices: Collection[str]) -> None:
    """Check that names are known, or the one word all."""
    for name in names:
        if list(names) != ["all"] and name not in choices:
            raise InputError(f"{key}: {UnknownNameError(kind, name, ('all', *choices))}")
