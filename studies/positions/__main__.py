"""Make tables and figures: ``python -m studies.positions FOLDER``."""

from __future__ import annotations

import sys
from functools import partial
from pathlib import Path

import pandas as pd

from accelstudy.basics.progress import track
from accelstudy.drawing.saving import save_all
from studies.positions import efficiency, stopping


def main(folder: Path) -> None:
    """Write the tables and figures of both studies to a folder."""
    settings = track(stopping.SETTINGS, "sessions")
    sessions = pd.concat([stopping.simulate(*each) for each in settings], ignore_index=True)
    summary, table = stopping.summary_table(sessions), efficiency.efficiency_table()
    folder.mkdir(parents=True, exist_ok=True)
    for name, rows in (("sessions", sessions), ("stopping", summary), ("efficiency", table)):
        rows.to_parquet(folder / f"{name}.parquet")
    figures = {
        "stopping": partial(stopping.stopping_figure, summary),
        "efficiency": partial(efficiency.efficiency_figure, table),
    }
    save_all(figures, folder)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
