"""How long each way takes to a relative standard error of 1e-3."""

import math
from dataclasses import replace
from pathlib import Path
from time import process_time

import numpy as np

from accelstudy.study.config import read_study
from accelstudy.study.estimate import MIN_REPLICATES
from accelstudy.study.replicates import simulate
from accelstudy.study.statistics import TILT, simulated_statistics, statistics
from problem import APPROACHES, SCHEME
from timing import short, table
from ways import WAYS

CONFIG = Path(__file__).parents[1] / "config" / "config.yaml"
WANTED = 1e-3
QUANTITIES = ("sd of a parameter", "rms of the tilt", "95 % bound of the tilt")
PILOT = 20_000
"""Plain calibrations that tell how many are needed."""


def run(speeds):
    """Calibrations {approach: {quantity: count}} that are needed, and seconds of each way.

    Parameters
    ----------
    speeds : {approach: {way: (rounds,) calibrations/s}}, as of `speeds.py`
    """
    study = read_study(CONFIG)
    needed, seconds = {}, {}
    for cell in study.cells:
        if cell.name != f"bias-scale-nonorthogonality/{SCHEME}/{cell.approach}":
            continue
        name = cell.approach
        plain = replace(cell, replicates=PILOT, compiled=False)
        needed[name] = _needed(_plain(plain), PILOT)
        rates = {way: float(np.median(each)) for way, each in speeds[name].items()}
        seconds[name] = {
            way: {what: count / rate for what, count in needed[name].items()}
            for way, rate in rates.items()
        }
        some = replace(cell, replicates=1000, compiled=False)
        few = _needed(simulated_statistics(some, 1), 1000)
        controlled = {}
        for what, count in few.items():
            own = replace(cell, replicates=max(MIN_REPLICATES, math.ceil(count)), compiled=False)
            simulated_statistics(own, 1)  # what is traced is kept
            start = process_time()
            simulated_statistics(own, 1)
            controlled[what] = process_time() - start, own.replicates
        seconds[name]["controlled"] = controlled
    return needed, seconds


def _plain(cell):
    """Statistics without linear theory."""
    return statistics(cell, simulate(cell, 1)._replace(linear=[]))


def _needed(found, count):
    """Calibrations for the wanted error, from the errors of so many."""
    bound = found.quantile(TILT, "both", 0.95)
    relative = (
        np.sqrt(np.mean((found["sd"].error / found["sd"].value) ** 2)),
        (found["tilt_rms"].error / found["tilt_rms"].value).max(),
        float(bound.error / bound.value),
    )
    return {what: count * (r / WANTED) ** 2 for what, r in zip(QUANTITIES, relative, strict=True)}


def tables(result):
    """One row for each way, the slowest last."""
    needed, seconds = result
    head, rows = ["way"], []
    for name in APPROACHES:
        head += [f"{name}: {what}" for what in QUANTITIES]
    row = ["this package, with linear theory as control variate"]
    for name in APPROACHES:
        row += [
            f"{short(took)} s ({count} calibrations)"
            for took, count in (seconds[name]["controlled"][what] for what in QUANTITIES)
        ]
    rows.append(row)
    row = ["calibrations without it"]
    row += [short(needed[name][what]) for name in APPROACHES for what in QUANTITIES]
    rows.append(row)
    slowest = seconds[APPROACHES[0]]
    ways = [way for way in slowest if way != "controlled"]
    for way in sorted(ways, key=lambda way: slowest[way][QUANTITIES[0]]):
        times = [seconds[name][way][what] for name in APPROACHES for what in QUANTITIES]
        rows.append([WAYS.get(way).title, *(f"{short(time)} s" for time in times)])
    return table(head, *rows)
