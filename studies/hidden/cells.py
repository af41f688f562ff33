"""Cells: kinds of campaigns, each with a number of campaigns and seeds of its own."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from itertools import combinations
from math import ceil, nan
from pathlib import Path
from typing import Any

import numpy as np

from accelstudy.basics.errors import InputError
from accelstudy.effects import effect_names, get_effect
from accelstudy.files.outputs import whole_file
from studies.hidden.config import KINDS, HiddenConfig
from studies.hidden.physics.atlas import atlas
from studies.hidden.physics.generate import Case

CHUNK = 800
"""Campaigns in one job: minutes of work, so that starting Python does not matter."""


@dataclass(frozen=True)
class Cell:
    """Campaigns of one case, so many."""

    case: Case
    count: int = 1

    @property
    def what(self) -> str:
        """What is hidden: names of effects, kind of noise or gross error; empty for nothing."""
        return self.case.noise or self.case.gross or "+".join(self.case.effect)

    @property
    def size(self) -> float:
        """Noncentrality λ, of either effect; NaN where there is none."""
        return self.case.lam[0] if self.case.lam else nan

    @property
    def sigma(self) -> str:
        """Whether the campaigns state their sigma, in words."""
        return "given" if self.case.sigma_known else "not given"

    @property
    def name(self) -> str:
        """Name, unique within a study."""
        what = "" if not self.what else f"{self.what}/"
        size = "" if not self.case.lam else f"{self.size:g}/"
        session = f"{self.case.design}/{self.case.approach}/sigma {self.sigma}"
        return f"{self.case.set}/{what}{size}{session}"

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


def _kinds(config: HiddenConfig) -> Iterator[tuple[list[Case], int]]:
    """Each kind and size: the cases among which its campaigns are spread, and how many they are."""
    places = config.places
    if config.nothing is not None:
        yield [Case("null", *place) for place in places], config.nothing.campaigns
    for name, block in config.blocks():
        for kind in config.kinds(name):
            able = [place for place in places if kind in KINDS[name][1](*place[:2])]
            if not able and block.kinds != ["all"]:
                raise InputError(f"{name}.kinds: no session of the study can show {kind}")
            hidden: dict[str, Any] = (
                {name: kind} if name in ("noise", "gross") else {"effect": (kind,)}
            )
            for size in getattr(block, "sizes", [None]):
                lam = () if size is None else (size,)
                yield [Case(name, *p, lam=lam, **hidden) for p in able], block.campaigns
    for size in config.two.sizes if config.two else ():
        pairs = [(place, pair) for place in places for pair in distinct_pairs(*place[:2])]
        cases = [Case("two", *place, effect=pair, lam=(size, size)) for place, pair in pairs]
        yield cases, config.two.campaigns if config.two else 0


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
    each, more = divmod(count, max(len(cases), 1))
    for i, case in enumerate(sorted(cases, key=_digest)):
        if number := each + (i < more):
            yield Cell(case, number)


def number_of_chunks(config: HiddenConfig) -> int:
    """Number of jobs into which the campaigns of a study are divided."""
    return ceil(config.campaigns / CHUNK)


def write_plan(config: HiddenConfig, path: str | Path) -> None:
    """Write the campaigns of each chunk, so that the jobs need not plan the study again."""
    with whole_file(path) as temporary:
        plan = chunks(study_cells(config), number_of_chunks(config))
        temporary.write_text(json.dumps(plan), encoding="utf-8")


def chunks(cells: Sequence[Cell], number: int) -> list[list[tuple[dict[str, Any], int, int]]]:
    """Campaigns of cells in a number of chunks, as equal as they can be: case, first, one past."""
    ends = np.cumsum([cell.count for cell in cells])
    bounds = np.linspace(0, ends[-1], number + 1).round().astype(int)
    result = []
    for start, stop in zip(bounds[:-1].tolist(), bounds[1:].tolist(), strict=True):
        parts = []
        for cell, end in zip(cells, ends.tolist(), strict=True):
            before = end - cell.count
            first, last = max(start - before, 0), min(stop - before, cell.count)
            if first < last:
                parts.append((asdict(cell.case), first, last))
        result.append(parts)
    return result


def planned(path: str | Path, chunk: int) -> Iterator[tuple[Cell, int]]:
    """Cells and numbers of the campaigns of a chunk, as `write_plan` wrote them."""
    for case, first, stop in json.loads(Path(path).read_text(encoding="utf-8"))[chunk]:
        content: dict[str, Any] = {
            k: tuple(v) if isinstance(v, list) else v for k, v in case.items()
        }
        for k in range(first, stop):
            yield Cell(Case(**content), stop - first), k
