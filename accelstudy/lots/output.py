"""What a lot writes: JSON, the model of the type, a figure and a page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from accelstudy.basics import suggested
from accelstudy.basics.errors import InputError
from accelstudy.basics.names import path_name
from accelstudy.basics.units import GON, MGON, shown_unit, to_display
from accelstudy.basics.wording import probability
from accelstudy.campaign.calibration.assessment import assess
from accelstudy.campaign.calibration.document import json_number, write_json
from accelstudy.campaign.calibration.fit import CampaignFit
from accelstudy.campaign.calibration.output import SUSPECT, calibration_content
from accelstudy.campaign.sensor_type import TYPE_FILE
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
from accelstudy.lots.calibrated import CalibratedLot, TypeParameter
from accelstudy.lots.evidence import shown
from accelstudy.lots.passes import LEVEL
from accelstudy.lots.type_file import write_type
from accelstudy.pages import lines, write_page

Array = NDArray[np.float64]

EACH = "each"
"""Folder of the calibrations of the sensors."""


def said(calibrated: CalibratedLot) -> list[str]:
    """Say what the model lacks, what it is worth, which sensors are odd; the verdict is first."""
    lot = calibrated.lot
    found = [one for one, _ in lot.effects]
    first = found[0].names if found else ()
    likeliest = [max(each.odds.items(), key=itemgetter(1))[0] for each in lot.sensors]
    return lines(
        "lots/wording.txt.j2",
        "verdict",
        lot,
        shown,
        found,
        [f"{_either(names[:3])} ({probability(p)})" for names, p in lot.alternatives],
        alone=sum(each.p_value < LEVEL for each in lot.sensors),
        single=sum(name in first for name in likeliest),
        close=[_either(names[:3]) for names in lot.close],
        tilt=calibrated.tilt,
        max_tilt=MAX_TILT_GON * GON,
    )


def _either(names: Sequence[str]) -> str:
    """Names that mean the same, in words."""
    return " or ".join(map(shown, names))


def lot_document(calibrated: CalibratedLot) -> dict[str, Any]:
    """Describe a lot, in SI."""
    lot, tilt = calibrated.lot, calibrated.tilt
    return {
        "schema_version": 1,
        "sensors": len(lot.sensors),
        "anything": {"p_value": lot.p_value, "missing": lot.missing, "level": LEVEL},
        "effects": [
            {
                "names": list(found.names),
                "posterior": found.posterior,
                "share": found.share,
                "share_ci95": list(found.share_ci95),
                "parameters": [
                    {
                        "name": one.name,
                        "mean": json_number(one.mean),
                        "scatter": json_number(one.scatter),
                        "scatter_ci95": [json_number(bound) for bound in one.scatter_interval()],
                        "sigma": json_number(one.sigma),
                        "unit": one.unit,
                    }
                    for one in calibrated.parameters_of(spec)
                ],
            }
            for found, spec in lot.effects
        ],
        "explained": lot.explained,
        "close": [list(names) for names in lot.close],
        "alternatives": [{"names": list(n), "posterior": p} for n, p in lot.alternatives],
        "odd": [
            {
                "campaign": one.campaign,
                "posterior": one.posterior,
                "names": list(one.names),
                "reason": f"it shows {_either(one.names)}, and the others do not",
            }
            for one in lot.odd
        ],
        "each": [
            {
                "campaign": campaign,
                "names": list(names),
                "posterior": p,
                "failed": str(fit) if isinstance(fit, InputError) else None,
            }
            for (campaign, names, p), fit in zip(lot.each(), calibrated.fits, strict=True)
        ],
        "left_out": [
            {"campaign": name, "reason": why} for name, why in calibrated.left_out.items()
        ],
        "tilt": None
        if tilt is None
        else {
            "roll_mgon": float(tilt[0] / MGON),
            "pitch_mgon": float(tilt[1] / MGON),
            "max_tilt_gon": MAX_TILT_GON,
        },
        "verdict": " ".join(said(calibrated)),
    }


def write_lot(
    calibrated: CalibratedLot, content: Mapping[str, Any], folder: Path, place: str | Path
) -> None:
    """Write lot.json, type.yaml, report.html, the figure, and a calibration of each sensor.

    Parameters
    ----------
    calibrated : CalibratedLot
    content : of `lot_document`
    folder : Path, to write to
    place : path of the results, for the commands that the page gives
    """
    for i, fit in enumerate(calibrated.fits, start=1):
        if isinstance(fit, CampaignFit):
            its_own = folder / EACH / f"{i:04d}-{path_name(fit.campaign.name, 'sensor')}"
            its_own.mkdir(parents=True)
            write_json(its_own / "calibration.json", calibration_content(assess(fit)))
    steps = []
    if write_type(calibrated, folder):
        of_type = Path(place) / TYPE_FILE
        command = suggested.calibrate("CAMPAIGN", of_type, calibrated.approach.name, of_type)
        steps.append(("Calibrate the next sensor of the type, with what these tell", command))
    write_page(
        folder / "report.html",
        "lots/report.html.j2",
        content["verdict"],
        doc=content,
        state=calibrated.lot.state,
        lines=said(calibrated),
        shown=shown,
        figures=save_all({"sensors": lambda: sensors_figure(calibrated)}, folder / "figures"),
        next_steps=steps,
    )
    files = (path for path in folder.rglob("*") if path.is_file())
    names = sorted(path.relative_to(folder).as_posix() for path in files)
    write_json(folder / "lot.json", {**content, "files": names})


def sensors_figure(calibrated: CalibratedLot) -> Figure:
    """Draw what each sensor has of what the model lacks, with 95 % intervals, a parameter a row."""
    parameters = _drawn(calibrated)
    figure = new_figure(FULL, 24 + 30 * len(parameters))
    panels = figure.subplots(len(parameters), 1, sharex=True, squeeze=False)[:, 0]
    for ax, parameter in zip(panels, parameters, strict=True):
        _draw_parameter(ax, parameter)
    panels[-1].set_xlabel("sensor")
    figure.suptitle("Each sensor with its 95 % interval; band: the type, ± 2 scatter; circle: odd")
    return figure


def draw_sensors(ax: Axes, calibrated: CalibratedLot) -> None:
    """Draw the first parameter that `sensors_figure` shows."""
    _draw_parameter(ax, _drawn(calibrated)[0])
    ax.set_xlabel("sensor")


def _drawn(calibrated: CalibratedLot) -> Sequence[TypeParameter | None]:
    """Parameters that are drawn; None stands for those of a lot in which there are none."""
    of_each = (calibrated.parameters_of(spec) for _, spec in calibrated.lot.effects)
    return [parameter for parameters in of_each for parameter in parameters] or [None]


def _draw_parameter(ax: Axes, parameter: TypeParameter | None) -> None:
    """Draw a parameter of each sensor with its interval, the type as a band, and odd sensors."""
    if parameter is None:
        say_empty(ax, "nothing of the catalogue was found")
        return
    name, unit, strange = parameter.name, parameter.unit, ~parameter.usual
    places = np.arange(1, len(parameter.values) + 1)
    colour = group_colour(group_of(name))
    each, sigma = (to_display(x, unit) for x in (parameter.values, parameter.sigmas))
    mean, scatter = (float(to_display(x, unit)) for x in (parameter.mean, parameter.scatter))
    ax.axhspan(mean - 2 * scatter, mean + 2 * scatter, color=MISSING)
    ax.axhline(mean, color=colour, linewidth=0.8)
    ax.axhline(0, color=INK, linewidth=0.8)
    ax.errorbar(places, each, 1.96 * sigma, fmt="o", color=colour, capsize=2)
    ax.plot(places[strange], each[strange], "o", markersize=9, markerfacecolor="none",
            color=SUSPECT)  # fmt: skip
    ax.set_ylabel(f"{symbol(name)} / ({shown_unit(unit)})")
