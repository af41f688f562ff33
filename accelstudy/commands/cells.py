"""The command that lists the cells of a study."""

from __future__ import annotations

from pathlib import Path

import click

from accelstudy.commands.options import PATH, example


@click.command("cells", epilog=example("accelstudy cells config/config.yaml"))
@click.argument("configs", nargs=-1, required=True, type=PATH)
def cells_command(configs: tuple[Path, ...]) -> None:
    """List the cells of a study.

    Cells that cannot be estimated are listed with the reason. CONFIGS are YAML files; a later one
    overlays those before it, as with Snakemake's --configfile.
    """
    from accelstudy.design.estimability import estimability
    from accelstudy.study.config import read_study

    study = read_study(*configs)
    chosen = study.cells
    for cell in chosen:
        found = estimability(
            cell.positions, cell.estimated_model, cell.conditions, cell.noise, hold=cell.hold
        )
        state = found.reason or f"r = {found.redundancy}, {cell.replicates} replicates"
        click.echo(f"{cell.name}: {state}")
    replicates = sum(cell.replicates for cell in chosen)
    click.echo(f"\n{len(chosen)} cells, up to {replicates} calibrations")
