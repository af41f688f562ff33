"""Which model, scheme and approach leaves which tilt error."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from accelstudy.figures.registry import Tables, figure
from accelstudy.figures.style import (
    FULL,
    HATCH,
    INK,
    MISSING,
    in_order_of_models,
    model_title,
    new_figure,
    say_empty,
)
from accelstudy.figures.swept import swept_noise
from accelstudy.schemes import get_scheme
from accelstudy.study.config import StudyConfig

ANGLES = ("roll", "pitch")
ROW_MM = 4.6
COLOURS = "viridis_r"


@figure(
    "leveling-overview",
    title="Tilt error that each calibration leaves",
    category="Study",
    tables=("cells", "leveling"),
    when=lambda study: not swept_noise(study),
)
def tilt_errors(tables: Tables, study: StudyConfig) -> Figure:
    """Matrices scheme × model, one for each angle and approach, with the rms in mgon."""
    cells, leveling = tables["cells"], tables["leveling"]
    models = in_order_of_models(cells["model"])
    schemes = sorted(set(cells["scheme"]), key=lambda name: (get_scheme(name).n_positions, name))
    approaches = list(dict.fromkeys(cells["approach"]))
    values = _values(cells, leveling)
    known = np.concatenate([values[angle].dropna().to_numpy() for angle in ANGLES])
    fig = new_figure(FULL, 52 + 2 * ROW_MM * max(len(schemes), 4))
    axes = fig.subplots(len(ANGLES), max(len(approaches), 1), sharex=True, sharey=True,
                        squeeze=False)
    norm = LogNorm(*_limits(known))
    for row, angle in zip(axes, ANGLES, strict=True):
        for ax, approach in zip(row, approaches, strict=False):
            its = values[values["approach"] == approach]
            grid = its.pivot_table(index="scheme", columns="model", values=angle, dropna=False)
            grid = grid.reindex(index=schemes, columns=models)
            run = set(zip(its["scheme"], its["model"], strict=True))
            _draw_matrix(ax, grid, run, norm)
            ax.set_title(f"{angle}, {approach}")
    axes[0, 0].set_yticks(range(len(schemes)), [get_scheme(name).title for name in schemes])
    for ax in axes[-1]:
        ax.set_xticks(range(len(models)), [model_title(name).replace(": ", ":\n", 1)
                                           .replace(" + cubic", "\n+ cubic") for name in models],
                      rotation=90)
    image = axes[0, 0].images[0] if axes[0, 0].images else None
    if image is not None and len(known):
        bar = fig.colorbar(image, ax=axes, label="rms tilt error / mgon", pad=0.02, aspect=40)
        bar.ax.yaxis.set_major_formatter("{x:g}")
    fig.legend(
        handles=[Patch(facecolor=MISSING, edgecolor="#999999", hatch=HATCH, linewidth=0,
                       label="not estimable")],
        loc="outside lower center",
    )
    return fig
