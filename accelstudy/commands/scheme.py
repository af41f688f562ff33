"""The command that prints the directions of a scheme."""

from __future__ import annotations

import click

from accelstudy.basics.progress import show
from accelstudy.commands.options import SCHEME, angle_unit_option, example


@click.command("scheme", epilog=example("accelstudy scheme fibonacci-24"))
@click.argument("name", type=SCHEME)
@angle_unit_option
def scheme_command(name: str) -> None:
    """Print the directions of a scheme, with its source.

    They are directions of gravity in the axes of the sensor, as a CSV table.
    """
    import numpy as np
    import pandas as pd

    from accelstudy.basics.units import attitude_unit, to_attitude
    from accelstudy.leveling.angles import angles_of
    from accelstudy.schemes import get_scheme

    chosen = get_scheme(name)
    show(f"# {chosen.title} ({chosen.status}): {chosen.source}")
    attitudes = to_attitude(angles_of(-chosen.directions))
    columns = ["x", "y", "z", *(f"{angle}_{attitude_unit()}" for angle in ("roll", "pitch"))]
    click.echo(
        pd.DataFrame(np.hstack([chosen.directions, attitudes]), columns=columns).to_csv(
            index_label="position", float_format="%.6f"
        ),
        nl=False,
    )
