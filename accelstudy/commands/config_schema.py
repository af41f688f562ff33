"""The command that prints the schema of configurations."""

from __future__ import annotations

import json

import click

from accelstudy.commands.options import example


@click.command("config-schema", epilog=example("accelstudy config-schema"))
def config_schema_command() -> None:
    """Print the JSON schema of configurations.

    Editors check a configuration against it while you write.
    """
    from accelstudy.study.config import config_schema

    click.echo(json.dumps(config_schema(), indent=2, ensure_ascii=False))
