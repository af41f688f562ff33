"""What to do after a diagnosis, with the commands."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from accelstudy.basics import suggested
from accelstudy.basics.wording import comma_list, words
from accelstudy.diagnosis.result import Diagnosis
from accelstudy.sensors.sensor import not_affine


def next_steps(
    diagnosis: Diagnosis,
    calibration: Mapping[str, Any] | None,
    campaign: str | Path,
    place: str | Path,
) -> list[tuple[str, str]]:
    """Say what to do next, most urgent first: what for, and the command.

    Parameters
    ----------
    diagnosis : Diagnosis
    calibration : mapping, of `diagnosed_calibration`; None if there is none
    campaign, place : paths of the folders of the campaign and of the results
    """
    d, steps = diagnosis, []
    chosen, result = (campaign, d.model.name, d.approach.name), Path(place) / suggested.HERE
    if d.recognised is not None:
        command = suggested.calibrate(*chosen)
        steps.append(("Correct the campaign, and calibrate it then", command))
    if d.verdict in ("narrowed", "unknown"):
        which = "the next positions" if d.next_positions else "positions"
        what = f"Add {which} to the campaign, and diagnose it again"
        steps.append((what, suggested.diagnose(*chosen)))
    if d.better_for_leveling == "base":
        command = suggested.calibrate(*chosen)
        return [*steps, ("Calibrate with the base model, which levels better", command)]
    if calibration is None or not calibration["quality"]["plausible"]:
        return steps
    use = "Level a log with the calibration that is beside this page"
    steps.append((use, suggested.apply(result)))
    inside = not_affine(d.extended)
    form, why = "c", ""
    if inside:
        form, why = "json", f"; no matrix can hold {comma_list([words(name) for name in inside])}"
    steps.append((f"Take it to a device{why}", suggested.export(form, result)))
    if d.extended is not d.model:
        command = suggested.calibrate("CAMPAIGN", Path(place) / "model.yaml", d.approach.name)
        steps.append(("Calibrate the next campaign with this model", command))
    return steps
