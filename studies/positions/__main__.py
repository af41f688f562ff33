"""Make tables and figures: ``python -m studies.positions FOLDER``."""

from __future__ import annotations

import sys
from pathlib import Path

import pandas as pd
from matplotlib.figure import Figure

from accelstudy.basics.progress import track
from accelstudy.drawing.saving import save
from accelstudy.drawing.style import DPI
from studies.positions import efficiency, stopping


def main(folder: Path) -> None:
    """Write the tables and figures of both studies to a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    table = efficiency.efficiency_table(efficiency.TASKS, efficiency.SCHEMES, efficiency.POSITIONS)
    _write(folder, "efficiency", table, efficiency.efficiency_figure(table))
    settings = track(stopping.SETTINGS, "sessions")
    sessions = pd.concat([stopping.simulate(each, stopping.SEED) for each in settings])
    summary = stopping.summary_table(sessions)
    sessions.to_parquet(folder / "sessions.parquet")
    _write(folder, "stopping", summary, stopping.stopping_figure(summary))


def _write(folder: Path, name: str, table: pd.DataFrame, figure: Figure) -> None:
    table.to_parquet(folder / f"{name}.parquet")
    save(figure, folder / f"{name}.svg", folder / f"{name}.png", name.capitalize(), DPI)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
