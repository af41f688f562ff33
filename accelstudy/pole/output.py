"""The results for a pole as files: tables, figure and sentences."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from accelstudy.basics.units import GON
from accelstudy.drawing.saving import save
from accelstudy.drawing.style import DPI
from accelstudy.files.outputs import whole_file
from accelstudy.files.tables import write_table
from accelstudy.pole.budget import Budget, budget
from accelstudy.pole.figure import budget_figure
from accelstudy.pole.sensor import CalibratedSensor
from accelstudy.pole.setup import Setup
from accelstudy.pole.simulation import simulate
from accelstudy.pole.statement import agreement, limits, remarks, shown_tilts

STEPS = 50
"""Steps of the tilt in the figure and in the table."""


@dataclass(frozen=True)
class PoleResult:
    """Results for a pole.

    Attributes
    ----------
    shown : Budget, at the tilts that are printed
    sentences : tuple of str, on what limits the foot, and whether the Monte Carlo agrees
    """

    shown: Budget
    sentences: tuple[str, ...]


def write_pole(
    setup: Setup,
    sensor: CalibratedSensor,
    tilt_range: float,
    replicates: int,
    seed: int,
    folder: Path,
    provenance: Mapping[str, Any] | None = None,
) -> PoleResult:
    """Calculate a pole and write `pole.json`, two tables and the figure into a folder.

    Parameters
    ----------
    setup : Setup
    sensor : CalibratedSensor
    tilt_range : float, rad
    replicates : int, of the Monte Carlo, for each tilt and direction
    seed : int
    folder : Path
    provenance : mapping, optional
        Provenance of the tables; by default a hash of all their inputs, and the seed.
    """
    given = {
        "setup_si": asdict(setup),
        "sensor": sensor.sheet.name,
        "calibration": sensor.origin,
        "model": sensor.model.name,
        "mounting": sensor.mounting.name,
        "tilt_range_gon": tilt_range / GON,
        "replicates": replicates,
        "seed": seed,
    }
    content = json.dumps([given, sensor.parameters.tolist(), sensor.covariance.tolist()])
    origin = provenance or {
        "config_hash": hashlib.sha256(content.encode()).hexdigest()[:16],
        "seed": seed,
    }
    all_tilts = budget(setup, sensor, np.linspace(0.0, tilt_range, STEPS + 1))
    shown = budget(setup, sensor, shown_tilts(tilt_range))
    simulated = simulate(setup, sensor, shown.tilts, replicates, seed)
    sentences = (*limits(shown), *remarks(shown), agreement(simulated))
    folder.mkdir(parents=True, exist_ok=True)
    write_table(folder / "budget.parquet", all_tilts.table(), origin)
    write_table(folder / "monte-carlo.parquet", simulated, origin)
    save(
        budget_figure(all_tilts, simulated),
        folder / "budget.svg",
        folder / "budget.png",
        "Error of the foot of a pole",
        DPI,
    )
    with whole_file(folder / "pole.json") as path:
        text = json.dumps({**given, "said": sentences}, indent=2, ensure_ascii=False)
        path.write_text(text + "\n", encoding="utf-8")
    return PoleResult(shown, sentences)
