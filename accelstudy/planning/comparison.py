"""A comparison of sensors: the accuracy that each reaches over time, by hand and with a robot."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from accelstudy.basics.units import GON, MGON, display_unit, to_display
from accelstudy.drawing.saving import save
from accelstudy.drawing.style import DPI, FULL, STYLE, approach_colour, log_ticks, new_figure
from accelstudy.files.tables import write_table
from accelstudy.planning.answer import by_time
from accelstudy.planning.candidates import candidates
from accelstudy.planning.question import Question, get_sensor
from accelstudy.planning.wording import model_words
from accelstudy.schemes.optimal import stored_designs

TILT_RANGE = 30 * GON
HOLDS = (1.0, 10.0, 60.0)
"""Durations of a hold that are compared, s."""
COLUMNS = 3
"""Panels side by side."""


def compare_sensors(
    sensors: Sequence[str], outputs: Mapping[str, str], provenance: Mapping[str, Any]
) -> None:
    """Compare sensors; `outputs` has the paths of `table`, `svg` and `png`."""
    table = front_table(sensors)
    write_table(outputs["table"], table, provenance)
    with mpl.rc_context(STYLE):  # type: ignore[arg-type]
        figure = front_figure(table)
    save(figure, outputs["svg"], outputs["png"], "Sensors", DPI)


def front_table(sensors: Sequence[str]) -> pd.DataFrame:
    """Candidates that leave less error than all quicker ones, for each sensor and equipment.

    They come from linear theory, for schemes that have a name. Columns are in the units in their
    names.
    """
    rows = []
    optimal = tuple(f"i-optimal-{n}" for n in stored_designs()["I"])
    for name in sensors:
        sheet = get_sensor(name)
        holds = HOLDS if sheet.position_sigma is None else ()
        question = Question(1.0, TILT_RANGE, sheet, holds=holds, schemes=optimal)
        compared = candidates(question)
        for equipment in question.equipment:
            best = np.inf
            for c in by_time(c for c in compared if c.equipment == equipment):
                if c.rms >= best:
                    continue
                best = c.rms
                rows.append(
                    {
                        "sensor": sheet.name,
                        "title": sheet.title,
                        "equipment": equipment.name,
                        "minutes": c.seconds / 60,
                        "rms_mgon": c.rms / MGON,
                        "model": c.model.name,
                        "parameters": model_words(c.model),
                        "scheme": c.scheme.name,
                        "n_positions": c.scheme.n_positions,
                        "hold_s": c.hold,
                        "unknown": ", ".join(sheet.unknown),
                    }
                )
    return pd.DataFrame(rows)


def front_figure(table: pd.DataFrame) -> Figure:
    """Draw the fronts, a panel for each sensor."""
    names = list(dict.fromkeys(table["sensor"]))
    n_rows = -(-len(names) // COLUMNS)
    figure = new_figure(FULL, 15 + 50 * n_rows)
    axes = figure.subplots(n_rows, COLUMNS, sharex=True, sharey=True, squeeze=False)
    error = to_display(table["rms_mgon"] * MGON, "rad")
    low, high = float(error.min()) / 1.3, min(float(error.max()), 300 * float(error.min())) * 1.3
    for ax, name in zip(axes.flat, names, strict=False):
        for equipment, rows in table[table["sensor"] == name].groupby("equipment", sort=False):
            ax.step(
                rows["minutes"], to_display(rows["rms_mgon"] * MGON, "rad"), where="post",
                color=approach_colour(str(equipment)),
                label={"gravity": "by hand", "robot": "with a robot"}[str(equipment)],
            )  # fmt: skip
        ax.set_title(name)
        ax.set_xscale("log")
        ax.set_yscale("log")
        ax.set_ylim(low, high)
        log_ticks(ax.xaxis, table["minutes"].min(), table["minutes"].max())
        log_ticks(ax.yaxis, low, high)
    for ax in axes.flat[len(names) :]:
        ax.set_visible(False)
    figure.supxlabel("time in the field / minutes", fontsize=8)
    figure.supylabel(f"tilt error left, rms / {display_unit('rad')}", fontsize=8)
    axes.flat[0].legend(loc="upper right")
    return figure
