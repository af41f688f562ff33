"""How commands print what is no result with a page: tables, texts and mappings."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import click

from accelstudy.basics.progress import say, show

if TYPE_CHECKING:
    import pandas as pd

INDENT = "    "


def tell_value(value: Any) -> None:
    """Print what a verb returns; a table with its title and its legend, unless it is quiet."""
    if isinstance(value, str):
        click.echo(value, nl=not value.endswith("\n"))
    elif isinstance(value, dict):
        click.echo(json.dumps(value, indent=2, ensure_ascii=False))
    elif value is not None:
        tell_table(value)


def tell_table(table: pd.DataFrame) -> None:
    """Print a table."""
    if title := table.attrs.get("title"):
        say(f"{title}\n")
    decimals = table.attrs.get("decimals", {})
    shown = {k: ["-" if x != x else f"{x:.{n}f}" for x in table[k]] for k, n in decimals.items()}
    click.echo(table.assign(**shown).to_string(index=False))
    if legend := table.attrs.get("legend"):
        say(f"\n{legend}")


def tell_sigmas(table: pd.DataFrame) -> None:
    """Print a check of sigmas, and what it can find."""
    click.echo(table.to_string(index=False, float_format="{:.4g}".format))
    say("sigma: as the adjustment claims it; ratio: sigma / sd_empirical.")
    click.echo(table.attrs["finds"])


def tell_models(table: pd.DataFrame) -> None:
    """Print the models, and the presets of the paper."""
    from accelstudy.sensors.models import PRESETS

    for name, row in table.iterrows():
        click.echo(f"{name} ({row['n_parameters']}): {row['parameters']}")
    click.echo("\nTable 1:")
    width = max(len(preset.source) for preset in PRESETS)
    for preset in PRESETS:
        click.echo(f"  {preset.source:{width}s} {preset.model} in {preset.scheme}")


def tell_directions(table: pd.DataFrame) -> None:
    """Print the directions of a scheme as CSV."""
    show(f"# {table.attrs['title']}")
    click.echo(table.to_csv(float_format="%.6f"), nl=False)


def tell_cells(table: pd.DataFrame) -> None:
    """Print the cells of a study, and how many calibrations they are."""
    for name, (redundancy, replicates, reason) in zip(table.index, table.values, strict=True):
        click.echo(f"{name}: {reason or f'r = {redundancy}, {replicates} replicates'}")
    click.echo(f"\n{len(table)} cells, up to {table['replicates'].sum()} calibrations")


def tell_public(table: pd.DataFrame) -> None:
    """Print the list of public data."""
    for name, row in table.iterrows():
        click.echo(f"{name}: {row['description']}\n    {row['licence']}, {row['url']}")


def tell_effects(table: pd.DataFrame) -> None:
    """Print effects of the sensor and of the rig, and noise effects, or a table.

    Parameters and typical sizes are in the units shown to people, settings in SI as specs have
    them.
    """
    from accelstudy.basics.units import angle_note
    from accelstudy.verbs.tables import catalogue

    if "equation" not in table:
        tell_table(table)
        return
    parts = {f"Effects of the {part}": table[table["part"] == part] for part in ("sensor", "rig")}
    parts["Noise effects"] = catalogue("noise effects")
    texts = ("\n".join([f"{head}\n", *_items(rows)]) for head, rows in parts.items())
    click.echo("\n\n".join(texts))
    say(f"\n{angle_note()}.")


def _items(table: pd.DataFrame) -> Iterator[str]:
    """Lines on each row of a catalogue."""
    from accelstudy.basics.units import display_unit, to_display
    from accelstudy.verbs.tables import plain_number

    for name, row in table.iterrows():
        yield f"{name}: {row['equation']}"
        lines = [row["summary"], row["plugin"] and f"of the plug-in {row['plugin']}"]
        settings = row["settings"] and f"settings: {row['settings']}"
        if "parameters" in row:
            low, high = map(
                plain_number, to_display(row[["typical_low", "typical_high"]], row["unit"])
            )
            size = f"[{display_unit(row['unit'])}], typically {low} … {high}"
            lines += [f"{row['parameters']} {size}", settings]
            lines += [row["needs"] and f"needs the {row['needs']} of each hold"]
            lines += [row["family"] and f"family: {row['family']}"]
        elif "typical_low" in row:
            low, high = map(plain_number, (row["typical_low"], row["typical_high"]))
            unit = "" if row["unit"] == "1" else f" {row['unit']}"
            lines += [settings, f"{row['setting']} typically {low} … {high}{unit}"]
        else:
            lines.append(settings)
        yield from (f"{INDENT}{line}" for line in lines if line)
