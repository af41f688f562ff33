"""The command that sets up a study of one's own."""

from __future__ import annotations

from pathlib import Path

import click

from accelstudy.basics.progress import say, warn
from accelstudy.commands.options import PATH, example, force_option


@click.command("init", epilog=example("accelstudy init my-study"))
@click.argument("folder", type=PATH)
@force_option
def init_command(folder: Path, force: bool) -> None:
    """Set up a study of your own in a new FOLDER.

    It gets a Snakefile, a small configuration to edit, a profile and a README. The workflow itself
    stays in the installed package.
    """
    from importlib.util import find_spec

    from accelstudy.study.new_study import new_study

    name = new_study(folder, force)
    say(f"study: {folder}")
    say(f"Edit {folder / 'config' / 'config.yaml'}; then, in {folder}: snakemake --cores 2")
    say(f"Results will be in {folder / 'results' / name}.")
    if find_spec("snakemake") is None:
        warn("Snakemake is not installed, which runs the study: pip install 'accelstudy[workflow]'")
