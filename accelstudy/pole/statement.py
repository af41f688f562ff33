"""The budget in words: the error of the foot, what limits it, and what would help."""

from __future__ import annotations

import numpy as np
import pandas as pd

from accelstudy.basics.units import GON, attitude_unit, to_attitude
from accelstudy.basics.wording import comma_list, estimate, quantity_text, words
from accelstudy.pole.budget import Budget
from accelstudy.pole.sensor import COEFFICIENTS
from accelstudy.pole.sources import sources

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
    tilt = quantity_text(float(budget.tilts[-1]), "rad")
    total, up = budget.horizontal()[-1], budget.vertical()[-1]
    radius = float(np.max(budget.total.radius[-1]))
    sentences = [
        f"At a tilt of {tilt} the foot is wrong by {_mm(total)} horizontally and {_mm(up)} in "
        f"height (rms); horizontally it is wrong by less than {_mm(radius)} in 95 of 100 cases."
    ]
    part = {each.name: float(budget.horizontal(each.name)[-1]) for each in sources()}
    rest = np.sqrt(max(total**2 - part[TOP] ** 2, 0.0))
    worst = max((each for each in sources() if each.name != TOP), key=lambda each: part[each.name])
    if part[TOP] > part[worst.name]:
        top = next(each for each in sources() if each.name == TOP)
        sentences.append(f"The {top.title} limits it: {_mm(part[TOP])}. {top.remedy}")
        sentences.append(
            f"All other sources together contribute {_mm(rest)}, most of it the {worst.title}: "
            f"{_mm(part[worst.name])}. {worst.remedy}"
        )
    elif part[worst.name] > 0:
        without = np.sqrt(max(total**2 - part[worst.name] ** 2, 0.0))
        sentences.append(
            f"The {worst.title} limits it: {_mm(part[worst.name])}; without it {_mm(without)} of "
            f"{_mm(total)} would be left. {worst.remedy}"
        )
    inside = [each for each in sources() if each.sensor and part[each.name] > 0]
    whole = float(np.sqrt(sum(part[each.name] ** 2 for each in inside)))
    named = comma_list([f"{each.title} {_mm(part[each.name])}" for each in inside])
    sentences.append(f"The tilt sensor contributes {_mm(whole)}: {named or 'nothing is counted'}.")
    return sentences


def remarks(budget: Budget) -> list[str]:
    """Say what is not counted, since the data sheet lacks it or the calibration corrects it."""
    sensor, setup = budget.sensor, budget.setup
    wanted = (
        {"bias_instability", "acceleration_random_walk", "repeatability"} if setup.age else set()
    )
    if setup.temperature_change:
        wanted |= {f"{name}_per_kelvin" for name in COEFFICIENTS if name not in sensor.corrected}
    sentences = []
    if missing := [words(name) for name in sensor.sheet.unknown if name in wanted]:
        sentences.append(
            f"The data sheet {sensor.sheet.name!r} lacks {comma_list(missing, 'and')}: counted as "
            "zero."
        )
    if setup.temperature_change and sensor.corrected:
        what = comma_list([f"the {name}" for name in sensor.corrected])
        sentences.append(
            f"The calibration corrects the change of {what} with temperature; it is not counted."
        )
    return sentences


def agreement(simulated: pd.DataFrame) -> str:
    """Say whether the Monte Carlo agrees with linear theory."""
    worst, where = 0.0, simulated.iloc[-1]
    for _, row in simulated.iterrows():
        for part in ("horizontal", "vertical"):
            error = row[f"standard_error_{part}_m"]
            apart = abs(row[f"simulated_{part}_m"] - row[f"linear_{part}_m"])
            if error > 0 and apart / error > worst:
                worst, where = apart / error, row
    last = simulated.iloc[-1]
    rms = estimate(last["simulated_horizontal_m"], last["standard_error_horizontal_m"], "m")
    sentence = (
        f"Monte Carlo with the exact geometry, {int(last['replicates'])} readings: "
        f"{' ± '.join(rms)} "
        f"mm horizontally; {100 * last['inside_95']:.1f} % lie within the circles of 95 %."
    )
    if worst > BEYOND_CHANCE:
        tilt = quantity_text(float(where["tilt_gon"]) * GON, "rad")
        sentence += (
            f" At {tilt} it differs from linear theory by more than chance: trust the Monte Carlo."
        )
    return sentence


def _mm(metres: float) -> str:
    return f"{1e3 * metres:.2g} mm" if metres < 1e-3 else f"{1e3 * metres:.1f} mm"
