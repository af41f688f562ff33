"""The command that lists sensor models."""

from __future__ import annotations

import click

from accelstudy.commands.options import example


@click.command("models", epilog=example("accelstudy models"))
def models_command() -> None:
    """List sensor models, and the presets of Table 1.

    Commands take compositions, too: models and effects joined by +, as in
    bias-scale+warm_up(tau=300).
    """
    from accelstudy.sensors.models import MODELS, PRESETS, get_model

    for name in MODELS:
        model = get_model(name)
        click.echo(f"{name} ({model.n_parameters}): {', '.join(model.parameter_names)}")
    click.echo("\nTable 1:")
    width = max(len(preset.source) for preset in PRESETS)
    for preset in PRESETS:
        click.echo(f"  {preset.source:{width}s} {preset.model} in {preset.scheme}")
