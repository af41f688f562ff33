"""The command that lists position schemes."""

from __future__ import annotations

import click

from accelstudy.basics.progress import say, track
from accelstudy.commands.options import (
    SCHEME,
    angle_unit_option,
    approach_option,
    example,
    model_option,
    quiet_option,
)


@click.command(
    "schemes", epilog=example("accelstudy schemes --approach robot fibonacci-24 mclaren-24")
)
@model_option
@approach_option("gravity")
@click.argument("names", nargs=-1, type=SCHEME)
@angle_unit_option
@quiet_option
def schemes_command(model: str, approach: str, names: tuple[str, ...]) -> None:
    """List position schemes and what they can determine.

    NAMES are those of schemes, such as fibonacci-60 or random-20-7. Without them all are listed.
    """
    import pandas as pd

    from accelstudy.approaches import get_approach
    from accelstudy.basics.units import angle_note, attitude_unit, to_attitude
    from accelstudy.design.estimability import estimability
    from accelstudy.schemes import get_scheme, scheme_families, scheme_names
    from accelstudy.sensors.models import get_model
    from accelstudy.simulation.hold_plan import check_needs_no_plan

    chosen_model, chosen_approach = get_model(model), get_approach(approach)
    check_needs_no_plan(chosen_model)
    rows = []
    for name in track(names or scheme_names(), "schemes"):
        scheme = get_scheme(name)
        determined = estimability(scheme, chosen_model, chosen_approach)
        rows.append(
            {
                "scheme": scheme.name,
                "n": scheme.n_positions,
                "status": scheme.status,
                "rank": f"{determined.rank}/{len(determined.parameter_names)}",
                "condition": f"{determined.condition:.1f}" if determined.estimable else "-",
                "r": determined.redundancy,
                "m": f"{determined.fourth_moment:.4f}",
                f"pole/{attitude_unit()}": f"{to_attitude(determined.pole_distance):.1f}",
                "not estimable": ", ".join(determined.not_estimable),
            }
        )
    say(f"model {chosen_model.name}, approach {approach}\n")
    click.echo(pd.DataFrame(rows).to_string(index=False))
    say(
        "\nrank and condition: of the scaled design matrix at the ideal sensor;"
        "\nr: conditions - unknowns; m: mean of x²y²;"
        "\npole: distance to the x axis, where roll is undefined;"
        f"\n{angle_note()}."
        f"\nFamilies: {', '.join(scheme_families())}."
    )
