"""What to do after a diagnosis, with the commands."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from accelstudy.campaign.gauges import not_affine
from accelstudy.diagnosis.pipeline import Diagnosis
from accelstudy.wording import joined, words


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
    approach = ["--approach", d.approach.name]
    again = ["accelstudy", "calibrate", str(campaign), "--model", d.model.name, *approach]
    if d.recognised is not None:
        command = shlex.join([*again, "--out", f"{d.campaign.name}-calibrated"])
        steps.append(("Correct the campaign, and calibrate it then", command))
    if d.verdict == "unknown":
        look = ["accelstudy", "diagnose", str(campaign), "--model", d.model.name, *approach]
        command = shlex.join([*look, "--out", f"{d.campaign.name}-diagnosis"])
        steps.append(("Add positions to the campaign, and diagnose it again", command))
    if calibration is None:
        return steps
    use = "Level a log with the calibration that is beside this page"
    steps.append((use, "accelstudy apply calibration.json LOG --out leveled.csv"))
    inside = not_affine(d.extended)
    form, why = "c", ""
    if inside:
        form, why = "json", f"; no matrix can hold {joined([words(name) for name in inside])}"
    steps.append((f"Take it to a device{why}", f"accelstudy export calibration.json --form {form}"))
    if d.extended is not d.model:
        command = f"accelstudy calibrate CAMPAIGN --model model.yaml {shlex.join(approach)}"
        steps.append(("Calibrate the next campaign with this model", f"{command} --out calibrated"))
    return steps
