"""What to do after a diagnosis, with the commands."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from accelstudy.basics import suggested
from accelstudy.basics.wording import comma_list, words
from accelstudy.campaign.calibration.gauges import not_affine
from accelstudy.diagnosis.result import Diagnosis


def next_steps(
    diagnosis: Diagnosis, calibration: Mapping[str, Any] | None, campaign: str | Path = "CAMPAIGN"
) -> list[tuple[str, str]]:
    """Say what to do next, most urgent first: what for, and the command.

    Parameters
    ----------
    diagnosis : Diagnosis
    calibration : mapping, of `diagnosed_calibration`; None if there is none
    campaign : path of the campaign's folder
    """
    d, steps = diagnosis, []
    model, approach, name = d.model.name, d.approach.name, d.campaign.name
    if d.recognised is not None:
        command = suggested.calibrate(campaign, model, approach, f"{name}-calibrated")
        steps.append(("Correct the campaign, and calibrate it then", command))
    if d.verdict in ("narrowed", "unknown"):
        which = "the next positions" if d.next_positions else "positions"
        what = f"Add {which} to the campaign, and diagnose it again"
        steps.append((what, suggested.diagnose(campaign, model, approach, name)))
    if calibration is None or not calibration["quality"]["plausible"]:
        return steps
    use = "Level a log with the calibration that is beside this page"
    steps.append((use, suggested.apply()))
    inside = not_affine(d.extended)
    form, why = "c", ""
    if inside:
        form, why = "json", f"; no matrix can hold {comma_list([words(name) for name in inside])}"
    steps.append((f"Take it to a device{why}", suggested.export(form)))
    if d.extended is not d.model:
        command = suggested.calibrate("CAMPAIGN", "model.yaml", approach, "calibrated")
        steps.append(("Calibrate the next campaign with this model", command))
    return steps
