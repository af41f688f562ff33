"""The command that prints the verdicts on claims."""

from __future__ import annotations

from pathlib import Path

import click

from accelstudy.commands.options import PATH, example


@click.command("claims", epilog=example("accelstudy claims results/paper"))
@click.argument("results", type=PATH)
def claims_command(results: Path) -> None:
    """Print the verdicts on claims as Markdown.

    RESULTS is the folder of a study, such as results/paper. The paper's claims stand first, then
    those of this project about what simulation adds to linear theory.
    """
    from accelstudy.files.tables import read_table
    from accelstudy.study.claims.page import claims_markdown

    click.echo(claims_markdown(read_table(results / "claims.parquet")), nl=False)
