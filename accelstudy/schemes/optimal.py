"""Positions that minimise the variances of the nine parameters, or of leveling with them."""

import json
from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from accelstudy.basics.arrays import Array
from accelstudy.basics.errors import InputError
from accelstudy.schemes.registry import register

TABLE = Path(__file__).with_name("optimal.json")


@register(
    "d-optimal-9",
    title="D-optimal",
    status="stand-in",
    source="extremal points of degree 2, Sloan & Womersley (2004), Adv. Comput. Math. 21, "
    "107-125, for the 9 positions of Zhang et al. (2010), Meas. Sci. Technol. 21, 015107",
)
def d_optimal_9() -> Array:
    """Nine positions for nine parameters, with the largest possible determinant; redundancy 0.

    They are a triangular prism with a cap on each side. With triangles of radius r and caps of
    radius 1 the determinant is proportional to (1-r)^5 (1+r)^9 r^8, which 11 r² - 2 r - 4 = 0
    maximises. A rotation does not change it: here the prism stands along x, 44° off the roll pole.
    """
    r = (1 + 3 * np.sqrt(5)) / 11
    x = np.sqrt(1 - r**2)
    angle = np.radians([0, 120, 240])
    triangle = np.column_stack([np.zeros(3), np.sin(angle), np.cos(angle)])
    return np.vstack([triangle, [x, 0, 0] - r * triangle, [-x, 0, 0] - r * triangle])


@register("d-optimal-N", title="D-optimal", status="generated", source="accelstudy design")
def d_optimal(n: int) -> Array:
    """The n positions of the largest determinant for a calibration by the norm of gravity.

    From 16 positions on there are many such sets, all as good as the whole sphere.
    """
    return _stored(n, "D")


@register("i-optimal-N", title="I-optimal", status="generated", source="accelstudy design")
def i_optimal(n: int) -> Array:
    """The n positions after which roll and pitch are best, for tilts up to 50 gon.

    They are for a calibration by the norm of gravity; `accelstudy design` makes others.
    """
    return _stored(n, "I")


def _stored(n: int, criterion: str) -> Array:
    table = stored_designs()[criterion]
    if n not in table:
        raise InputError(
            f"{criterion.lower()}-optimal-{n} is not stored; {criterion}-optimal are "
            f"{ranges(table)} positions. Others are found by accelstudy design --positions {n} "
            f"--criterion {criterion} --approach gravity --out mine.yaml"
        )
    return np.array(table[n]["directions"])


@lru_cache
def stored_designs() -> dict[str, dict[int, dict[str, Any]]]:
    """Designs by criterion and number of positions.

    Each has its directions, the lower bound of the criterion (a logarithm, of `TASK` in
    `tests/helpers/optimal_schemes.py`, which made the table) and its efficiency against it.
    """
    read = json.loads(TABLE.read_text(encoding="utf-8"))
    return {name: {int(n): one for n, one in table.items()} for name, table in read.items()}


def ranges(numbers: Iterable[int]) -> str:
    """Ascending whole numbers for people, as "9 to 40, 45, 50"."""
    runs: list[list[int]] = []
    for n in numbers:
        if runs and n == runs[-1][-1] + 1:
            runs[-1].append(n)
        else:
            runs.append([n])
    return ", ".join(f"{r[0]} to {r[-1]}" if len(r) > 1 else f"{r[0]}" for r in runs)
