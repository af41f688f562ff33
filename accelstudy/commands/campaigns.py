"""Commands of verbs with parts of the terminal: several outputs, files, a session that goes on."""

from __future__ import annotations

import time
from collections.abc import Iterable
from contextlib import AbstractContextManager, ExitStack, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from accelstudy.basics.errors import InputError
from accelstudy.basics.progress import say, show, stage, warn
from accelstudy.basics.wording import plural
from accelstudy.commands.bridge import QUIET, Command, inputs_of
from accelstudy.files import outputs
from accelstudy.files.outputs import new_file, result_folder
from accelstudy.verbs import calibrations, campaigns, planning
from accelstudy.verbs.kinds import PATH, File, Force, verb

if TYPE_CHECKING:
    from accelstudy.campaign.importing.detection import Holds
    from accelstudy.campaign.session import Campaign

NO_DELIMITER = {"--delimiter": "it is told from the rows"}
"""The option of earlier versions, and what takes its place."""
POLL = 1.0
"""Seconds between two looks at a growing table."""


def run_import(
    log: tuple[Path, ...],
    out: Path,
    force: bool,
    figure: bool,
    sensors: tuple[str, ...],
    **given: Any,
) -> None:
    """Write a campaign for each sensor of a log."""
    from accelstudy.api.campaigns import Import
    from accelstudy.campaign.importing.logs import import_sensors, write_imported

    columns = dict(_sensor(text) for text in sensors)
    logs = Import.of(log, given, columns)
    folders = {name: out / name for name in logs.settings.sensors} or {"": out}
    inputs = [*map(Path, map(str, logs.files)), *inputs_of(campaigns.find_holds, given)]
    with ExitStack() as stack:
        made = {
            name: stack.enter_context(result_folder(folder, outputs.CAMPAIGN, inputs, force))
            for name, folder in folders.items()
        }
        imported = import_sensors(logs.files, logs.settings, logs.reference)
        for name, result in imported.items():
            write_imported(*result, made[name], figure)
    for name, result in imported.items():
        if name:
            say(f"sensor {name}")
        show_import(*result, folders[name], figure)


def _sensor(text: str) -> tuple[str, list[str]]:
    name, _, columns = text.partition("=")
    places = [column.strip() for column in columns.split(",")]
    if len(places) != 3 or not all(places):
        raise InputError(f"--sensor: expected a name and three columns, as a=1,2,3, not {text!r}")
    return name.strip(), places


def show_import(campaign: Campaign, holds: Holds | None, out: Path, figure: bool = True) -> None:
    """Tell what was imported, with its warnings, and where to."""
    for line in campaign.notes:
        say(line)
    for warning in campaign.warnings:
        warn(warning)
    if figure and holds is not None:
        say(f"figure: {out / 'segmentation.png'}")
    click.echo(f"campaign: {out} ({plural(campaign.n_positions, 'position')})")


IMPORT = Command(
    campaigns.find_holds,
    run_import,
    name="import",
    writes=outputs.CAMPAIGN,
    out="Folder of the campaign.",
    more="segmentation.png in the folder shows the holds with their numbers. With --sensor, which "
    "may be repeated as --exclude may, each sensor has a campaign of its own in the folder, which "
    "is named after the log and the sensor.",
    options=(
        click.Option(
            ["--sensor", "sensors"],
            multiple=True,
            help="Columns of one of several sensors: NAME=ax,ay,az.",
        ),
        click.Option(["--figure/--no-figure"], default=True, help="Draw the log with its holds."),
    ),
    sections={
        "The log": "columns sensors time time_unit rate variable",
        "Its numbers": "unit scale offset range frame",
        "The holds": "threshold window trim shortest exclude figure",
        "A log of blocks instead": "block",
        "A table of means instead": "means robot_sigma robot_unit",
        "A calibrated sensor beside it": (
            "reference_log reference reference_columns reference_offset"
        ),
        "The campaign": "out name gravity settings",
    },
    retired={"--join": "holds in one attitude are positions each", **NO_DELIMITER},
)


def run_simulate_campaign(
    out: Path, truth: Path | None, force: bool, name: str | None, **given: Any
) -> None:
    """Write a simulated campaign and, apart from it, the truth."""
    from accelstudy.campaign.format import write_campaign
    from accelstudy.campaign.simulated import write_truth

    # The truth enters first and is moved last: it may be meant for a folder that is made here.
    with (
        nullcontext() if truth is None else new_file(truth, force=force) as truth_file,
        result_folder(out, outputs.CAMPAIGN, force=force) as folder,
        stage("simulation"),
    ):
        campaign = campaigns.simulate_campaign(name=name or out.resolve().name, **given)
        write_campaign(campaign, folder, plausible=not given["gross_errors"])
        if truth_file is not None:
            write_truth(dict(campaign.truth), truth_file)
    click.echo(f"campaign: {out} ({campaign.n_positions} positions)")


SIMULATE_CAMPAIGN = Command(
    campaigns.simulate_campaign,
    run_simulate_campaign,
    writes=outputs.CAMPAIGN,
    out="Folder of the campaign.",
    more="The truth goes to --truth and nowhere else.",
    options=(click.Option(["--truth"], type=PATH, help="YAML file for the truth."),),
    sections={
        "What is written": "out truth name seed",
        "The sensor": "model effects size noise_effects gross_errors",
        "Its noise": "sigma sigma_known robot_sigma n_samples",
        "The holds": "scheme repeats repeat_first order approach yaw gravity",
        "Their conditions": "interval temperature temperature_order vibration",
    },
    retired={
        "--gross": "--gross-error takes it",
        "--sigma-unknown": "--no-sigma-known says it",
        "--robot-sigma-mgon": "--robot-sigma takes it with its unit, as 5mgon",
        "--samples-per-hold": "--n-samples takes it",
        "--no-time": "--interval none says it",
        "--hold": "campaigns have no slopes within holds",
    },
    shared=[QUIET],
)


def new_table(
    path: Path, inputs: Iterable[str | Path] = (), force: bool = False
) -> AbstractContextManager[Path]:
    """Return the place of a table, which is no spreadsheet; see `new_file`."""
    if path.suffix.lower() in (".xlsx", ".xls", ".ods"):
        raise InputError(f"{path}: a spreadsheet is not written; let it end in .csv or .parquet")
    return new_file(path, inputs, force)


APPLY = Command(
    calibrations.apply,
    make=calibrations.leveled,
    writes=new_table,
    out="CSV or Parquet file to write.",
    retired=NO_DELIMITER,
)


DATA_SHEET = Command(
    planning.data_sheet,
    writes=new_file,
    out="YAML file to write.",
    retired=NO_DELIMITER,
    shared=[QUIET],
)


@verb
def public(
    name: str | None = None,
    *,
    out: File | None = None,
    folder: File = "resources/public",
    force: Force = False,
) -> None:
    """Make a campaign of public data, or list what there is.

    A download is checked by its sha256.

    Parameters
    ----------
    name : str
        Name of the data; without it they are listed.
    out : path
        Folder of the campaign.
    folder : path
        Where the file is, in any subfolder, or is downloaded to.

    Examples
    --------
        accelstudy public
        accelstudy public xsens-mti --out xsens
    """
    from accelstudy.campaign.importing.logs import import_log, write_imported
    from accelstudy.campaign.importing.public import import_settings, public_data, public_file

    if name is None:
        for key, entry in public_data().items():
            click.echo(f"{key}: {entry.description}\n    {entry.licence}, {entry.url}")
        return
    settings = import_settings(name)
    if out is None:
        raise InputError("--out: give the folder of the campaign")
    place, downloads = Path(out), Path(folder)
    with result_folder(place, outputs.CAMPAIGN, [downloads], force) as campaign:
        imported = import_log(public_file(name, downloads), settings)
        write_imported(*imported, campaign)
    show_import(*imported, place)


PUBLIC = Command(public)


def run_advise(campaign: Path, watch: bool, **given: Any) -> None:
    """Print advice, again and again with --watch."""
    from accelstudy.api.advice import Adviser
    from accelstudy.sequential.running import Watch, read_running

    session = Watch(campaign)
    now = (session.look() if watch else None) or read_running(campaign)
    adviser = Adviser(now, campaign, **given)
    for warning in now.warnings:
        warn(warning)
    show(adviser(now).summary())
    if not watch:
        return
    say("\nwaiting for the next position; Ctrl-C ends")
    try:
        while True:
            time.sleep(POLL)
            try:
                changed = session.look()
            except InputError as error:
                click.echo("")
                warn(f"waiting for a whole table: {error}")
                continue
            if changed is not None:
                click.echo("")
                show(adviser(changed).summary())
    except KeyboardInterrupt:
        say("\nended")


ADVISE = Command(
    planning.advise,
    run_advise,
    options=(
        click.Option(["--watch"], is_flag=True, help="Wait for further positions until Ctrl-C."),
    ),
    sections={
        "What is wanted": "tilt_accuracy tilt_range",
        "The calibration": "approach model prior",
        "Positions to choose from": "attitudes pole_distance max_roll max_pitch",
        "The session": "watch",
    },
)


def new_scheme(*place: Any, **how: Any) -> AbstractContextManager[Path]:
    """Yield the file of a design."""
    from accelstudy.proposal.design import new_scheme

    return new_scheme(*place, **how)


DESIGN = Command(
    planning.find_positions,
    name="design",
    writes=new_scheme,
    out="YAML file for the positions.",
    sections={
        "The calibration": "model approach positions sigma robot_sigma gravity_sigma",
        "What the positions are to be good for": (
            "criterion tilt_range neglect discriminate prior after"
        ),
        "What the positions must keep to": "attitudes roll pitch pole_distance least_angle",
    },
    retired={"--mountings": "--attitudes takes a CSV file of the attitudes that a mount allows"},
)
