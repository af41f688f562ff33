"""The command that prints the schema of configurations."""

from __future__ import annotations

import json

import click

from accelstudy.commands.options import example


@click.command("config-schema", epilog=example("accelstudy config-schema"))
def config_schema_command() -> None:
    """Print the JSON schema of configurations.

    It is kept in workflow/schemas/config.schema.json.
    """
    from accelstudy.study.config import config_schema

    click.echo(json.dumps(config_schema(), indent=2, ensure_ascii=False))
