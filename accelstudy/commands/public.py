"""The command that makes a campaign of public data."""

from __future__ import annotations

from pathlib import Path

import click

from accelstudy.basics.errors import InputError
from accelstudy.commands.importing import show_result
from accelstudy.commands.options import PATH, angle_unit_option, example, force_option, quiet_option


@click.command(
    "public", epilog=example("accelstudy public", "accelstudy public xsens-mti --out xsens")
)
@click.argument("name", required=False)
@click.option("--out", type=PATH, help="Folder of the campaign.")
@click.option(
    "--folder",
    type=PATH,
    default="resources/public",
    show_default=True,
    help="Where the file is, in any subfolder, or is downloaded to.",
)
@force_option
@angle_unit_option
@quiet_option
def public_command(name: str | None, out: Path | None, folder: Path, force: bool) -> None:
    """Make a campaign of public data, or list what there is.

    NAME is that of the data; without it they are listed. A download is checked by its sha256.
    """
    from accelstudy.campaign.importing.logs import import_to
    from accelstudy.campaign.importing.public import import_settings, public_data, public_file
    from accelstudy.files.outputs import CAMPAIGN, result_folder

    if name is None:
        for key, entry in public_data().items():
            click.echo(f"{key}: {entry.description}\n    {entry.licence}, {entry.url}")
        return
    settings = import_settings(name)
    if out is None:
        raise InputError("--out: give the folder of the campaign")
    with result_folder(out, CAMPAIGN, [folder], force) as campaign:
        imported = import_to(campaign, public_file(name, folder), settings)
    show_result(*imported, out)
