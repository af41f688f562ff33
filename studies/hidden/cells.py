"""Cells: kinds of campaigns, each with a number of campaigns and seeds of its own."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from itertools import combinations, pairwise
from math import ceil, nan
from pathlib import Path
from typing import Any

import numpy as np

from accelstudy.basics.errors import InputError
from accelstudy.effects import effect_names, get_effect
from accelstudy.files.outputs import whole_file
from studies.hidden.config import HiddenConfig
from studies.hidden.physics import (
    NOISES,
    Case,
    invisible_effects,
    visible_effects,
    visible_gross,
    visible_outside,
    visible_unforeseen,
)
from studies.hidden.physics.atlas import atlas

CHUNK = 800
"""Campaigns in one job: minutes of work, so that starting Python does not matter."""


@dataclass(frozen=True)
class Cell:
    """Campaigns of one case.

    Attributes
    ----------
    case : Case
    count : int, number of campaigns
    """

    case: Case
    count: int

    @property
    def what(self) -> str:
        """What is hidden: names of effects, kind of noise or gross error; empty for nothing."""
        return self.case.noise or self.case.gross or "+".join(self.case.effect)

    @property
    def size(self) -> float:
        """Noncentrality λ, of either effect; NaN where there is none."""
        return self.case.lam[0] if self.case.lam else nan

    @property
    def name(self) -> str:
        """Name, unique within a study."""
        sigma = "sigma given" if self.case.sigma_known else "sigma not given"
        what = "" if not self.what else f"{self.what}/"
        size = "" if not self.case.lam else f"{self.size:g}/"
        return f"{self.case.set}/{what}{size}{self.case.design}/{self.case.approach}/{sigma}"

    @property
    def removed(self) -> tuple[str, ...]:
        """Effects that the diagnosis does not know: those of the family of what is hidden."""
        return family_of(self.case.effect[0]) if self.case.set == "removed" else ()

    def seed(self, seed: int, campaign: int) -> np.random.SeedSequence:
        """Seed of a campaign.

        It depends on the study's seed, the case and the number of the campaign only: no other cell
        or campaign changes it.
        """
        words = np.frombuffer(_digest(self.case), dtype="<u4").tolist()
        return np.random.SeedSequence([seed, *words], spawn_key=(campaign,))

    def one_in(self, every: int, campaign: int) -> bool:
        """Whether a campaign is chosen as one in so many, whatever other campaigns there are."""
        return int.from_bytes(_digest(self.case, campaign)[:8], "big") % every == 0


def _digest(case: Case, *numbers: int) -> bytes:
    """Hash of a case and of further numbers."""
    text = json.dumps([asdict(case), *numbers], sort_keys=True)
    return hashlib.sha256(text.encode()).digest()


@cache
def family_of(name: str) -> tuple[str, ...]:
    """Effects of the family of an effect, itself included."""
    family = get_effect(name).family
    return tuple(one for one in effect_names() if get_effect(one).family == family)


def study_cells(config: HiddenConfig) -> list[Cell]:
    """All cells of a study, in an order in which those of one session follow each other.

    The campaigns of a kind and size are spread evenly over all sessions that can show it.

    Raises
    ------
    InputError
        If no session of the study can show a kind that the configuration names.
    """
    cells = [cell for cases, count in _kinds(config) for cell in _spread(cases, count)]
    sessions = config.places

    def session(cell: Cell) -> tuple[tuple[str, ...], int]:
        case = cell.case
        return cell.removed, sessions.index((case.design, case.approach, case.sigma_known))

    return sorted(cells, key=session)


def write_plan(config: HiddenConfig, path: str | Path) -> None:
    """Write the campaigns of each chunk, so that the jobs need not plan the study again."""
    plan = [
        [{"case": asdict(cell.case), "campaigns": [part.start, part.stop]} for cell, part in chunk]
        for chunk in chunks(study_cells(config), number_of_chunks(config))
    ]
    with whole_file(path) as temporary:
        temporary.write_text(json.dumps(plan), encoding="utf-8")


def planned(path: str | Path, chunk: int) -> Iterator[tuple[Cell, int]]:
    """Cells and numbers of the campaigns of a chunk, as `write_plan` wrote them."""
    for part in json.loads(Path(path).read_text(encoding="utf-8"))[chunk]:
        content: dict[str, Any] = {
            k: tuple(v) if isinstance(v, list) else v for k, v in part["case"].items()
        }
        numbers = range(*part["campaigns"])
        for k in numbers:
            yield Cell(Case(**content), len(numbers)), k


def chunks(cells: Iterable[Cell], number: int) -> list[list[tuple[Cell, range]]]:
    """Divide the campaigns of cells into a number of chunks, as equal as they can be, in order."""
    cells = list(cells)
    ends = np.linspace(0, sum(cell.count for cell in cells), number + 1).round().astype(int)
    result: list[list[tuple[Cell, range]]] = [[] for _ in range(number)]
    first = 0
    for cell in cells:
        for chunk, (start, end) in zip(result, pairwise(ends.tolist()), strict=True):
            part = range(max(start - first, 0), min(end - first, cell.count))
            if part:
                chunk.append((cell, part))
        first += cell.count
    return result


def number_of_chunks(config: HiddenConfig) -> int:
    """Number of jobs into which the campaigns of a study are divided."""
    return ceil(config.campaigns / CHUNK)


def limit_cells(config: HiddenConfig) -> list[Cell]:
    """A campaign without any effect of each design and approach."""
    places = dict.fromkeys((design, approach) for design, approach, _ in config.places)
    return [Cell(Case("null", *place, sigma_known=True), 1) for place in places]


SEEN: Mapping[str, Callable[[str, str], Collection[str]]] = {
    "noise": lambda design, approach: tuple(NOISES),
    "one": visible_effects,
    "removed": visible_effects,
    "outside": visible_outside,
    "unforeseen": visible_unforeseen,
    "gross": visible_gross,
    "invisible": invisible_effects,
}
"""Kinds of each set that make sense in a design by an approach."""


def _kinds(config: HiddenConfig) -> Iterator[tuple[list[Case], int]]:
    """Each kind and size: the cases among which its campaigns are spread, and how many they are."""
    places = config.places
    if config.nothing is not None:
        yield [Case("null", *place) for place in places], config.nothing.campaigns
    for name, seen in SEEN.items():
        block = getattr(config, name)
        for kind in config.kinds(name) if block else ():
            able = [place for place in places if kind in seen(*place[:2])]
            if not able and block.kinds != ["all"]:
                raise InputError(f"{name}.kinds: no session of the study can show {kind}")
            hidden: dict[str, Any] = (
                {name: kind} if name in ("noise", "gross") else {"effect": (kind,)}
            )
            for size in getattr(block, "sizes", [None]):
                lam = () if size is None else (size,)
                yield [Case(name, *p, lam=lam, **hidden) for p in able], block.campaigns
    if config.two is not None:
        for size in config.two.sizes:
            yield (
                [
                    Case("two", *place, effect=pair, lam=(size, size))
                    for place in places
                    for pair in distinct_pairs(*place[:2])
                ],
                config.two.campaigns,
            )


@cache
def distinct_pairs(design: str, approach: str) -> tuple[tuple[str, str], ...]:
    """All two effects that a session can show, and that do not mean the same in it."""
    seen = atlas(design, approach)
    alike: dict[str, set[str]] = {name: set() for name in seen.visible}
    for shape in seen.shapes:
        alike[shape.effect.name].update(seen.same_as(shape))
    return tuple(pair for pair in combinations(seen.visible, 2) if pair[1] not in alike[pair[0]])


def _spread(cases: Sequence[Case], count: int) -> Iterator[Cell]:
    """Spread campaigns over cases; which cases get one more is as good as random."""
    if not cases:
        return
    each, more = divmod(count, len(cases))
    for i, case in enumerate(sorted(cases, key=_digest)):
        if number := each + (i < more):
            yield Cell(case, number)
