"""Make tables and figures: ``python -m studies.positions FOLDER``."""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib as mpl
import pandas as pd

from accelstudy.basics.progress import track
from accelstudy.drawing.saving import save
from accelstudy.drawing.style import DPI, STYLE
from studies.positions import efficiency, stopping


def main(folder: Path) -> None:
    """Write the tables and figures of both studies to a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    settings = track(stopping.SETTINGS, "sessions")
    sessions = pd.concat([stopping.simulate(*each) for each in settings], ignore_index=True)
    sessions.to_parquet(folder / "sessions.parquet")
    made = {
        "efficiency": (efficiency.efficiency_table(), efficiency.efficiency_figure),
        "stopping": (stopping.summary_table(sessions), stopping.stopping_figure),
    }
    for name, (rows, draw) in made.items():
        rows.to_parquet(folder / f"{name}.parquet")
        with mpl.rc_context(STYLE):  # type: ignore[arg-type]
            figure = draw(rows)
        save(figure, folder / f"{name}.svg", folder / f"{name}.png", name.capitalize(), DPI)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
