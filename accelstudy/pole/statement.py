"""The budget in words: the error of the foot, what limits it, and what would help."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd

from accelstudy.basics.units import GON, attitude_unit, to_attitude
from accelstudy.pages import lines
from accelstudy.pole.budget import Budget
from accelstudy.pole.sensor import COEFFICIENTS
from accelstudy.pole.sources import sources

TEMPLATE = "pole/wording.txt.j2"
BEYOND_CHANCE = 4.0
"""Standard errors of the Monte Carlo; linear theory is called wrong beyond them."""
TOP = "top"
"""Name of the source that remains even if the pole is upright."""


def shown_tilts(tilt_range: float) -> np.ndarray:
    """Tilts of the printed table, rad: a fifth, three fifths and all of the range."""
    return tilt_range * np.array([0.2, 0.6, 1.0])


def budget_text(budget: Budget) -> str:
    """Table of the contributions at the tilts of a budget, for a terminal."""
    rows = [(each.title, [each]) for each in sources()]
    rows.append(("all but the position of the top", [e for e in sources() if e.name != TOP]))
    rows.append(("all together", list(sources())))
    width = max(len(title) for title, _ in rows)
    heads = [f"{float(to_attitude(tilt)):.4g} {attitude_unit()}" for tilt in budget.tilts]
    across = 10 * len(heads)
    lines = [
        f"{'rms / mm':{width}s}  {'horizontal':>{across}s}  {'in height':>{across}s}",
        f"{'':{width}s}  {_cells(heads)}  {_cells(heads)}",
    ]
    for title, parts in rows:
        both = (
            np.sqrt(np.sum([of(each.name) ** 2 for each in parts], axis=0))
            for of in (budget.horizontal, budget.vertical)
        )
        cells = "  ".join(_cells([f"{1e3 * value:.2f}" for value in values]) for values in both)
        lines.append(f"{title:{width}s}  {cells}")
    radius = [f"{1e3 * value:.2f}" for value in np.max(budget.total.radius, axis=-1)]
    return "\n".join([*lines, f"{'95 of 100 cases within':{width}s}  {_cells(radius)}"])


def _cells(texts: list[str]) -> str:
    return "".join(f"{text:>10s}" for text in texts)


def limits(budget: Budget) -> list[str]:
    """Say how wrong the foot is at the last tilt of a budget, and what limits it."""
    total, height = float(budget.horizontal()[-1]), float(budget.vertical()[-1])
    part = {each: float(budget.horizontal(each.name)[-1]) for each in sources()}
    rest = {each: math.sqrt(max(total**2 - error**2, 0.0)) for each, error in part.items()}
    (top,) = (each for each in part if each.name == TOP)
    worst = max((each for each in part if each is not top), key=part.__getitem__)
    radius = float(np.max(budget.total.radius[-1]))
    inside = {each: error for each, error in part.items() if each.sensor and error > 0}
    tilt = float(budget.tilts[-1])
    return [
        *lines(TEMPLATE, "limits", tilt, total, height, radius, part, rest, top, worst),
        *lines(TEMPLATE, "sensor", math.hypot(*inside.values()), inside),
    ]


def remarks(budget: Budget) -> list[str]:
    """Say what is not counted, since the data sheet lacks it or the calibration corrects it."""
    sensor, setup = budget.sensor, budget.setup
    wanted = (
        {"bias_instability", "acceleration_random_walk", "repeatability"} if setup.age else set()
    )
    if setup.temperature_change:
        wanted |= {f"{name}_per_kelvin" for name in COEFFICIENTS if name not in sensor.corrected}
    missing = [name for name in sensor.sheet.unknown if name in wanted]
    corrected = sensor.corrected if setup.temperature_change else ()
    return lines(TEMPLATE, "remarks", sensor.sheet, missing, corrected)


def agreement(simulated: pd.DataFrame) -> str:
    """Say whether the Monte Carlo agrees with linear theory."""
    chances = [
        (abs(row[f"simulated_{part}_m"] - row[f"linear_{part}_m"]) / error, row["tilt_gon"] * GON)
        for row in simulated.to_dict("records")
        for part in ("horizontal", "vertical")
        if (error := row[f"standard_error_{part}_m"]) > 0
    ]
    ratio, tilt = max(chances, key=lambda chance: chance[0], default=(0.0, 0.0))
    last = simulated.iloc[-1].to_dict()
    return lines(TEMPLATE, "agreement", last, tilt if ratio > BEYOND_CHANCE else None)[0]
