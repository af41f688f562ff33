"""The command that evaluates the campaigns of a lot together."""

from __future__ import annotations

from glob import glob, has_magic
from pathlib import Path

import click

from accelstudy.basics.errors import InputError
from accelstudy.basics.progress import say
from accelstudy.commands.options import (
    PATH,
    angle_unit_option,
    approach_option,
    example,
    force_option,
    given_once,
    model_option,
    quiet_option,
    seed_option,
)


@click.command("lot", epilog=example("accelstudy lot sensor-1 sensor-2 sensor-3 --out lot"))
@click.argument("campaigns", type=PATH, nargs=-1, required=True, metavar="CAMPAIGN...")
@click.option("--out", type=PATH, required=True, help="Folder to write to.")
@model_option
@approach_option(None)
@seed_option
@force_option
@angle_unit_option
@quiet_option
def lot_command(
    campaigns: tuple[Path, ...], model: str, approach: str | None, out: Path, seed: int, force: bool
) -> None:
    """Say what sensors of one type lack together.

    CAMPAIGN are folders, one per sensor, or patterns such as 'sensor-*'. They may differ in
    positions, columns and approach. What one campaign alone cannot show, many show together:
    whether anything is missing in the lot, at one level for all, in how many of the sensors, how
    large it is, and which sensor is odd.

    The folder of results gets report.html, lot.json, a figure and a calibration.json of each
    sensor. If effects are missing, these have them, and model.yaml has them for `--model`.
    """
    from accelstudy.approaches import get_approach
    from accelstudy.campaign.calibration.fit import usual_approach
    from accelstudy.campaign.format import read_campaign
    from accelstudy.files.outputs import LOT, result_folder
    from accelstudy.lots.lot import calibrations, weigh_lot, with_sizes
    from accelstudy.lots.output import write_lot
    from accelstudy.sensors.models import get_model

    folders = [path for given in campaigns for path in _folders(given)]
    if len(folders) < 2:
        raise InputError("CAMPAIGN: a lot has two sensors or more; `diagnose` takes one")
    given_once(folders, "sensor")
    chosen = get_model(model), None if approach is None else get_approach(approach)
    with result_folder(out, LOT, folders, force) as results:
        measured = [read_campaign(folder) for folder in folders]
        lot = weigh_lot(measured, *chosen, seed=seed)
        fits = calibrations(lot, measured, chosen[1])
        found = with_sizes(lot, fits, chosen[0])
        of_first = chosen[1] or usual_approach(measured[0])
        content = write_lot(lot, found, fits, of_first, results, out)
    click.echo(content["verdict"])
    say(f"report: {out / 'report.html'}")


def _folders(given: Path) -> list[Path]:
    """Folders that a pattern stands for, by name; anything else stands for itself."""
    if given.exists() or not has_magic(str(given)):
        return [given]
    found = sorted(path for path in map(Path, glob(str(given))) if path.is_dir())
    if not found:
        raise InputError(f"{given}: no folder has such a name")
    return found
