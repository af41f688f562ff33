"""What a lot writes: JSON, the model of the type, a figure and a page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from accelstudy.approaches import Approach
from accelstudy.basics import suggested
from accelstudy.basics.errors import InputError
from accelstudy.basics.names import path_name
from accelstudy.basics.units import GON, MGON, shown_unit, to_display
from accelstudy.basics.wording import probability
from accelstudy.campaign.calibration.assessment import assess
from accelstudy.campaign.calibration.document import json_number, write_json
from accelstudy.campaign.calibration.fit import CampaignFit
from accelstudy.campaign.calibration.output import SUSPECT, calibration_content
from accelstudy.campaign.of_type import TYPE_FILE
from accelstudy.drawing.saving import save_all
from accelstudy.drawing.style import (
    FULL,
    INK,
    MISSING,
    group_colour,
    group_of,
    new_figure,
    say_empty,
    symbol,
)
from accelstudy.leveling.error import MAX_TILT_GON
from accelstudy.lots.evidence import shown
from accelstudy.lots.lot import Lot
from accelstudy.lots.passes import LEVEL, Found, Size
from accelstudy.lots.type_file import write_type
from accelstudy.pages import lines, write_page

Array = NDArray[np.float64]

EACH = "each"
"""Folder of the calibrations of the sensors."""


def said(lot: Lot, found: Sequence[Found], tilt: Array | None) -> list[str]:
    """Say what the model lacks, what it is worth, which sensors are odd; the verdict is first."""
    alternatives = [
        f"{' or '.join(map(shown, names[:3]))} ({probability(p)})" for names, p in lot.alternatives
    ]
    top = [max(each.odds, key=lambda name, e=each: e.odds[name]) for each in lot.sensors]  # type: ignore[misc]
    close = [" or ".join(map(shown, names[:3])) for names in lot.close]
    single = sum(name in found[0].names for name in top) if found else 0
    return lines(
        "lots/wording.txt.j2",
        "verdict",
        lot,
        shown,
        found,
        alternatives,
        lot.odd,
        len(lot.sensors),
        sum(each.p_value < LEVEL for each in lot.sensors),
        single,
        close,
        tilt,
        MAX_TILT_GON * GON,
    )


def lot_document(
    lot: Lot,
    found: Sequence[Found],
    calibrated: Sequence[str | None],
    tilt: Array | None,
    left_out: Mapping[str, str],
) -> dict[str, Any]:
    """Describe a lot, in SI.

    Parameters
    ----------
    lot : Lot
    found : of `with_sizes`
    calibrated : for each sensor, why it has no calibration; None if it has one
    tilt : of `worth`, rad; None where nothing of the catalogue is missing
    left_out : mapping of campaigns that are not in the lot to why
    """
    return {
        "schema_version": 1,
        "sensors": len(lot.sensors),
        "anything": {"p_value": lot.p_value, "missing": lot.missing, "level": LEVEL},
        "effects": [
            {
                "names": list(f.names),
                "posterior": f.posterior,
                "share": f.share,
                "share_ci95": list(f.share_ci95),
                "parameters": [
                    {
                        "name": size.name,
                        "mean": json_number(size.mean),
                        "scatter": json_number(size.scatter),
                        "scatter_ci95": [json_number(bound) for bound in size.scatter_ci95],
                        "sigma": json_number(size.sigma),
                        "unit": size.unit,
                    }
                    for size in f.sizes
                ],
            }
            for f in found
        ],
        "explained": lot.explained,
        "close": [list(names) for names in lot.close],
        "alternatives": [{"names": list(n), "posterior": p} for n, p in lot.alternatives],
        "odd": [
            {"campaign": o.campaign, "posterior": o.posterior, "names": list(o.names),
             "reason": f"it shows {' or '.join(map(shown, o.names))}, and the others do not"}
            for o in lot.odd
        ],
        "each": [
            {"campaign": campaign, "names": list(names), "posterior": p, "failed": failed}
            for (campaign, names, p), failed in zip(lot.each(), calibrated, strict=True)
        ],
        "left_out": [{"campaign": name, "reason": why} for name, why in left_out.items()],
        "tilt": None
        if tilt is None
        else {
            "roll_mgon": float(tilt[0] / MGON),
            "pitch_mgon": float(tilt[1] / MGON),
            "max_tilt_gon": MAX_TILT_GON,
        },
        "verdict": " ".join(said(lot, found, tilt)),
    }  # fmt: skip


@dataclass(frozen=True, eq=False)
class LotReport:
    """All that is told of a lot.

    Attributes
    ----------
    lot : Lot
    found : of `with_sizes`
    fits : of `calibrations`
    tilt : of `worth`, rad; None where nothing of the catalogue is missing
    approach : Approach, of the first campaign
    left_out : as in `lot_document`
    """

    lot: Lot
    found: Sequence[Found]
    fits: Sequence[CampaignFit | InputError]
    tilt: Array | None
    approach: Approach
    left_out: Mapping[str, str]

    @cached_property
    def content(self) -> dict[str, Any]:
        """Content of lot.json."""
        failed = [str(fit) if isinstance(fit, InputError) else None for fit in self.fits]
        return lot_document(self.lot, self.found, failed, self.tilt, self.left_out)

    @property
    def state(self) -> str:
        """State in a word, as the badge of the page has it."""
        return "no_effect" if not self.lot.missing else "named" if self.found else "unknown"


def write_lot(report: LotReport, folder: str | Path, place: str | Path) -> None:
    """Write lot.json, type.yaml, report.html, the figure, and a calibration of each sensor.

    Parameters
    ----------
    report : LotReport
    folder : path, to write to
    place : path of the results, for the commands that the page gives
    """
    folder, lot, found, fits = Path(folder), report.lot, report.found, report.fits
    for i, fit in enumerate(fits, start=1):
        if isinstance(fit, CampaignFit):
            its_own = folder / EACH / f"{i:04d}-{path_name(fit.campaign.name, 'sensor')}"
            its_own.mkdir(parents=True)
            write_json(its_own / "calibration.json", calibration_content(assess(fit)))
    steps = []
    if write_type(lot, fits, folder):
        of_type = Path(place) / TYPE_FILE
        command = suggested.calibrate("CAMPAIGN", of_type, report.approach.name, of_type)
        steps.append(("Calibrate the next sensor of the type, with what these tell", command))
    drawn = save_all({"sensors": lambda: sensors_figure(lot, found)}, folder / "figures")
    sentences = said(lot, found, report.tilt)
    write_page(
        folder / "report.html",
        "lots/report.html.j2",
        " ".join(sentences),
        doc=report.content,
        state=report.state,
        lines=sentences,
        shown=shown,
        figures=drawn,
        next_steps=steps,
    )
    files = (path for path in folder.rglob("*") if path.is_file())
    names = sorted(path.relative_to(folder).as_posix() for path in files)
    write_json(folder / "lot.json", {**report.content, "files": names})


def sensors_figure(lot: Lot, found: Sequence[Found]) -> Figure:
    """Draw what each sensor has of what the model lacks, with 95 % intervals, a parameter a row."""
    sizes = [size for f in found for size in f.sizes]
    figure = new_figure(FULL, 24 + 30 * max(len(sizes), 1))
    panels = figure.subplots(max(len(sizes), 1), 1, sharex=True, squeeze=False)[:, 0]
    if not sizes:
        say_empty(panels[0], "nothing of the catalogue was found")
    for ax, size in zip(panels, sizes, strict=False):
        _draw_size(ax, lot, size)
    panels[-1].set_xlabel("sensor")
    figure.suptitle("Each sensor with its 95 % interval; band: the type, ± 2 scatter; circle: odd")
    return figure


def draw_sensors(ax: Axes, lot: Lot, found: Sequence[Found]) -> None:
    """Draw the first parameter that `sensors_figure` shows."""
    size = next((size for f in found for size in f.sizes), None)
    if size is None:
        say_empty(ax, "nothing of the catalogue was found")
    else:
        _draw_size(ax, lot, size)
    ax.set_xlabel("sensor")


def _draw_size(ax: Axes, lot: Lot, size: Size) -> None:
    """Draw a parameter of each sensor with its interval, the type as a band, and odd sensors."""
    odd = {o.campaign for o in lot.odd}
    strange = np.array([each.campaign in odd for each in lot.sensors])
    places = np.arange(1, len(lot.sensors) + 1)
    colour = group_colour(group_of(size.name))
    each, sigma = (to_display(x, size.unit) for x in (size.each, size.sigma_each))
    mean, scatter = (float(to_display(x, size.unit)) for x in (size.mean, size.scatter))
    ax.axhspan(mean - 2 * scatter, mean + 2 * scatter, color=MISSING)
    ax.axhline(mean, color=colour, linewidth=0.8)
    ax.axhline(0, color=INK, linewidth=0.8)
    ax.errorbar(places, each, 1.96 * sigma, fmt="o", color=colour, capsize=2)
    ax.plot(places[strange], each[strange], "o", markersize=9, markerfacecolor="none",
            color=SUSPECT)  # fmt: skip
    ax.set_ylabel(f"{symbol(size.name)} / ({shown_unit(size.unit)})")
