"""The command that evaluates the campaigns of a lot together."""

from __future__ import annotations

from glob import glob, has_magic
from pathlib import Path

import click

from accelstudy.basics.errors import InputError
from accelstudy.basics.names import natural
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
@click.option(
    "--cores",
    default=1,
    show_default=True,
    type=click.IntRange(min=1),
    help="Processes that work at once; the results do not depend on it.",
)
@force_option
@angle_unit_option
@quiet_option
def lot_command(
    campaigns: tuple[Path, ...],
    model: str,
    approach: str | None,
    out: Path,
    seed: int,
    cores: int,
    force: bool,
) -> None:
    """Say what the model of sensors of one type lacks.

    CAMPAIGN are folders, one per sensor, patterns such as 'sensor-*', or the list of a batch (a
    YAML file). They may differ in positions, columns and approach. What one campaign alone cannot
    show, many show together: whether anything is missing in the lot, at one level for all, in how
    many of the sensors, how large it is, and which sensor is odd.

    The folder of results gets report.html, lot.json, a figure, a calibration.json of each sensor
    with all that the model lacks, and type.yaml: the model of the type for `--model`, what these
    sensors tell of the next one for `--prior`, and a data sheet for `plan --sensor`.
    """
    from accelstudy import lot
    from accelstudy.files.outputs import LOT, result_folder

    folders = [path for given in campaigns for path in _folders(given)]
    given_once(folders, "sensor")
    with result_folder(out, LOT, folders, force) as results:
        found = lot(folders, model=model, approach=approach, seed=seed, cores=cores)
        found.write(results, out)
    click.echo(found.verdict)
    say(f"report: {out / 'report.html'}")


def _folders(given: Path) -> list[Path]:
    """Folders of a pattern, or of the list of a batch; anything else stands for itself."""
    if given.suffix in (".yaml", ".yml") and given.is_file():
        return _listed(given)
    if given.exists() or not has_magic(str(given)):
        return [given]
    found = sorted((path for path in map(Path, glob(str(given))) if path.is_dir()), key=natural)
    if not found:
        raise InputError(f"{given}: no folder has such a name")
    return found


def _listed(path: Path) -> list[Path]:
    """Folders of the campaigns that the list of a batch names."""
    from accelstudy.basics.plugins import only_named
    from accelstudy.campaign.batch.config import parse_batch
    from accelstudy.files.reading import read_layer

    content = read_layer(path)
    with only_named(content, path):
        tasks = parse_batch({**content, "plugins": []}, str(path)).tasks()
    for task in tasks:
        if task.kind != "campaign":
            raise InputError(
                f"{path}: {task.source}: is a {task.kind}; only campaigns can be in a lot here. "
                "Import it, or run the workflow of the campaigns with a section `lot`"
            )
    return [Path(task.source) for task in tasks]
