"""The configuration of a study of hidden effects: what may stand in `config/hidden-*.yaml`."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from accelstudy.basics.bounds import Range
from accelstudy.basics.errors import InputError, UnknownNameError
from accelstudy.config_names import ModelName
from accelstudy.effects import effect_names
from accelstudy.files.reading import config_hash
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
from studies.hidden.physics.atlas import invisible_effects, visible_effects
from studies.hidden.physics.designs import APPROACHES, DESIGNS
from studies.hidden.physics.effects import EFFECTS
from studies.hidden.physics.gross import GROSS, visible_gross
from studies.hidden.physics.measuring import NOISES
from studies.hidden.physics.oracle import visible_outside, visible_unforeseen
from studies.hidden.physics.outside import OUTSIDE
from studies.hidden.physics.unforeseen import UNFORESEEN

Names = OneOrMore[str]
Sizes = OneOrMore[Positive]
Every = Annotated[int, Field(ge=1)]

CAMPAIGNS = Range(1, 1_000_000)
"""Campaigns of a study; the most take days of computing."""

_EFFECTS = tuple(name for name in EFFECTS if name in effect_names())
Seen = Callable[[str, str], Collection[str]]
KINDS: Mapping[str, tuple[Sequence[str], Seen]] = {
    "noise": (tuple(NOISES), lambda design, approach: NOISES),
    "one": (_EFFECTS, visible_effects),
    "removed": (_EFFECTS, visible_effects),
    "outside": (tuple(OUTSIDE), visible_outside),
    "unforeseen": (tuple(UNFORESEEN), visible_unforeseen),
    "gross": (tuple(GROSS), visible_gross),
    "invisible": (_EFFECTS, invisible_effects),
}
"""Kinds that each set may have, and those that make sense in a design by an approach."""
SETS = ("nothing", "two", *KINDS)
"""Blocks of campaigns."""


class Nothing(Block):
    """Campaigns in which nothing is missing."""

    campaigns: Replicates = Field(description="in all")


class Kinds(Block):
    """Campaigns with one thing each that has no size: wrong noise, gross or invisible."""

    kinds: Names = Field(["all"], description="names, or all")
    campaigns: Replicates = Field(description="of each kind")


class Sized(Block):
    """Campaigns with one thing each, in several sizes."""

    kinds: Names = Field(["all"], description="names, or all")
    sizes: Sizes = Field(description="noncentralities λ")
    campaigns: Replicates = Field(description="of each kind and size")


class Pairs(Block):
    """Campaigns with two effects each."""

    sizes: Sizes = Field(description="noncentralities λ, of either effect")
    campaigns: Replicates = Field(description="of each size, each with two effects at random")


class Study(Block):
    """What both studies have."""

    study: PathName = Field(description="name; results go to results/<study>/")
    seed: Seed = Field(description="of all that is random")
    model: ModelName = Field("bias-scale-nonorthogonality", description="model that is diagnosed")
    diagnosis_seed: Seed = Field(1, description="of each diagnosis, as the option --seed")

    @property
    def fingerprint(self) -> str:
        """Hash of all that the numbers depend on, defaults included."""
        return config_hash(self.model_dump(mode="json", exclude={"public_folder"}))


class HiddenConfig(Study):
    """A study of hidden effects; results go to ``results/<study>``."""

    designs: Names = Field(["all"], description="sessions that are simulated, or all")
    approaches: Names = Field(["all"], description="gravity, robot, or all")
    sigma: OneOrMore[Literal["given", "not given"]] = Field(
        default=["given", "not given"], description="whether a campaign says how large its noise is"
    )
    baselines_every: Every = Field(
        20, description="of each kind and size every so many campaigns get to the simpler methods"
    )
    nothing: Nothing | None = Field(None, description="nothing is missing")
    noise: Kinds | None = Field(None, description="only the noise is not as it is said to be")
    one: Sized | None = Field(None, description="one effect of the catalogue")
    two: Pairs | None = Field(None, description="two effects of the catalogue")
    removed: Sized | None = Field(
        None, description="one effect whose family the diagnosis does not know"
    )
    outside: Sized | None = Field(None, description="physics that was never in the catalogue")
    unforeseen: Sized | None = Field(
        None, description="the same, invented when what can be learned was fixed"
    )
    gross: Kinds | None = Field(None, description="gross errors")
    invisible: Kinds | None = Field(None, description="effects that the session cannot show")

    @model_validator(mode="after")
    def _names_exist(self) -> Self:
        try:
            try:
                get_model(self.model)
            except InputError as error:
                raise InputError(f"model: {error}") from None
            _known("designs", "design", self.designs, DESIGNS)
            _known("approaches", "approach", self.approaches, APPROACHES)
            for name, block in self.blocks():
                _known(f"{name}.kinds", "kind", block.kinds, KINDS[name][0])
            if not self.campaigns:
                raise InputError(f"no campaigns; give at least one of {', '.join(SETS)}")
            CAMPAIGNS.check_key("campaigns in all", self.campaigns)
        except InputError as error:
            raise ValueError(str(error)) from None
        return self

    def blocks(self) -> Iterator[tuple[str, Kinds | Sized]]:
        """Sets of one thing each that are given, and their blocks."""
        blocks = ((name, getattr(self, name)) for name in KINDS)
        return ((name, block) for name, block in blocks if block is not None)

    def kinds(self, set_: str) -> list[str]:
        """Kinds of a set, spelled out."""
        chosen = getattr(self, set_).kinds
        return [*KINDS[set_][0]] if chosen == ["all"] else [*chosen]

    @property
    def places(self) -> list[tuple[str, str, bool]]:
        """Combinations of design, approach and whether sigma is given."""
        designs = DESIGNS if self.designs == ["all"] else self.designs
        approaches = APPROACHES if self.approaches == ["all"] else self.approaches
        return [
            (design, approach, sigma == "given")
            for design in designs
            for approach in approaches
            for sigma in self.sigma
        ]

    @property
    def campaigns(self) -> int:
        """Number of campaigns, at most: fewer where no session can show a kind."""
        return (
            (self.nothing.campaigns if self.nothing else 0)
            + (self.two.campaigns * len(self.two.sizes) if self.two else 0)
            + sum(
                block.campaigns * len(self.kinds(name)) * len(getattr(block, "sizes", [None]))
                for name, block in self.blocks()
            )
        )


def parse_hidden(content: Mapping[str, Any], source: str = "config") -> HiddenConfig:
    """Check a configuration; raise `InputError` with one line that names the source and the key."""
    return checked(HiddenConfig, content, source)


def _known(key: str, kind: str, names: Sequence[str], names_known: Sequence[str]) -> None:
    """Check that names are known, or the one word all."""
    for name in names:
        if list(names) != ["all"] and name not in names_known:
            raise InputError(f"{key}: {UnknownNameError(kind, name, ('all', *names_known))}")
