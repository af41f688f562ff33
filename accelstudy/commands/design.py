"""The command that finds the best positions for a calibration."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from accelstudy.basics.names import LONGEST
from accelstudy.basics.progress import say, stage
from accelstudy.basics.units import GON, MGON
from accelstudy.commands.options import (
    EFFECT,
    PATH,
    SCHEME,
    Quantity,
    Sectioned,
    angle_unit_option,
    approach_option,
    example,
    force_option,
    model_option,
    quiet_option,
    seed_option,
)

if TYPE_CHECKING:
    from accelstudy.proposal.proposal import Proposal

SECTIONS = {
    "The calibration": ("model", "approach", "positions", "sigma", "robot_sigma", "gravity_sigma"),
    "What the positions are to be good for": (
        "criterion",
        "tilt_range",
        "neglect",
        "discriminate",
        "prior",
        "after",
    ),
    "What the positions must keep to": (
        "attitudes",
        "mountings",
        "roll",
        "pitch",
        "pole_distance",
        "least_angle",
    ),
}
_TURN = 200 * GON


@click.command(
    "design",
    cls=Sectioned,
    sections=SECTIONS,
    epilog=example(
        "accelstudy design --positions 12 --tilt-range 30gon --least-angle 20gon "
        "--out my-scheme.yaml",
        "accelstudy simulate-campaign --scheme my-scheme.yaml --out designed-campaign",
    ),
)
@click.option("--out", type=PATH, required=True, help="YAML file for the positions.")
@model_option
@approach_option("robot")
@click.option("--positions", default=24, show_default=True, help="Number of positions.")
@click.option(
    "--sigma",
    type=Quantity("m/s^2"),
    default="2mm/s^2",
    show_default=True,
    help="Sd of a position's mean.",
)
@click.option(
    "--robot-sigma",
    type=Quantity("rad"),
    default="3.2mgon",
    show_default=True,
    help="Sd of the robot's roll and pitch.",
)
@click.option(
    "--gravity-sigma",
    type=Quantity("m/s^2"),
    default="0",
    help="Sd of the value of gravity; 0, the default, holds it fixed.",
)
@click.option(
    "--criterion",
    default="I",
    show_default=True,
    help="I: variance of roll and pitch; D: determinant of the parameters' covariance matrix; "
    "A: mean variance of the parameters; minimax: variance of the worse of roll and pitch.",
)
@click.option(
    "--tilt-range",
    type=Quantity("rad", GON / 10, 100 * GON),
    default="50gon",
    show_default=True,
    help="Largest tilt at which the calibrated sensor is used.",
)
@click.option(
    "--neglect",
    multiple=True,
    metavar="EFFECT[=SIZE]",
    help="An effect that the model leaves out, though the tilt is to be good. SIZE is the sd of "
    "its parameters, by default that of cheap equipment.",
)
@click.option(
    "--discriminate",
    nargs=2,
    type=EFFECT,
    metavar="EFFECT EFFECT",
    help="Two effects that are to be told from each other; then the tilt does not count.",
)
@click.option(
    "--prior",
    multiple=True,
    metavar="NAME=SIGMA",
    help="Sd of what is known of an effect or a parameter before, as bias=20mg or s_x=500ppm.",
)
@click.option("--after", type=SCHEME, help="Scheme that has been measured already.")
@click.option(
    "--attitudes",
    default="all",
    show_default=True,
    help="Those to choose from: all; cube: on faces, edges and corners; hand: in steps of 30° "
    "that an eye can judge; or a CSV file of those that are allowed.",
)
@click.option(
    "--mountings",
    type=int,
    help="How often the sensor may be mounted; each mounting is turned about one horizontal axis.",
)
@click.option(
    "--roll", nargs=2, type=Quantity("rad", -_TURN, _TURN), help="Least and largest roll."
)
@click.option(
    "--pitch", nargs=2, type=Quantity("rad", -_TURN / 2, _TURN / 2), help="Least and largest pitch."
)
@click.option(
    "--pole-distance",
    type=Quantity("rad", 0.0, _TURN / 2),
    help="Least angle to the vertical x axis, where roll is undefined.",
)
@click.option(
    "--least-angle",
    type=Quantity("rad", 0.0, _TURN),
    help="Least angle between any two positions.",
)
@seed_option
@click.option(
    "--starts",
    default=8,
    show_default=True,
    type=click.IntRange(1, 1000),
    help="Number of random sets from which the search starts.",
)
@force_option
@angle_unit_option
@quiet_option
def design_command(
    out: Path,
    force: bool,
    sigma: float,
    robot_sigma: float,
    gravity_sigma: float,
    roll: tuple[float, float] | None,
    pitch: tuple[float, float] | None,
    discriminate: tuple[str, str] | None,
    **options: Any,
) -> None:
    """Find the best positions for a calibration.

    The YAML file that comes out is a scheme: configurations and commands take its path wherever
    they take the name of a scheme. The positions are in an order that makes the ways between them
    short, with the last one near the first.
    """
    from accelstudy.basics import bounds
    from accelstudy.files.outputs import new_file
    from accelstudy.proposal.proposal import Proposal, write_design
    from accelstudy.proposal.request import Request
    from accelstudy.schemes import is_scheme_file
    from accelstudy.simulation.sessions import Noise

    bounds.SIGMA_FORCE.check_key("--sigma", sigma)
    bounds.SIGMA_ANGLE.check_key("--robot-sigma", robot_sigma / MGON)
    bounds.SIGMA_GRAVITY.check_key("--gravity-sigma", gravity_sigma)
    request = Request(
        noise=Noise(sigma, robot_sigma, gravity_sigma),
        roll=roll or None,
        pitch=pitch or None,
        discriminate=discriminate or None,
        **options,
    )
    read = [request.attitudes] if request.attitudes.endswith(".csv") else []
    if request.after is not None and is_scheme_file(request.after):
        read.append(request.after)
    if not out.name.endswith((".yaml", ".yml")):
        from accelstudy.basics.errors import InputError

        raise InputError(f"{out}: must end in .yaml, by which a file is known as a scheme")
    with new_file(out, read, force) as path:
        with stage("search"):
            proposal = Proposal.of(request)
        extra = {"turn_about": proposal.axes} if proposal.axes else None
        name = re.sub(r"[^\w.-]+", "-", out.stem).lstrip(".-")[: LONGEST // 2] or "scheme"
        kind = request.chosen.name
        kind = f"{kind}-optimal" if len(kind) == 1 else kind
        write_design(
            path,
            name,
            f"{name} ({kind})",
            f"accelstudy design, seed {request.seed}",
            proposal.directions,
            proposal.made(),
            extra,
        )
    click.echo(table(proposal))
    for line in summary(proposal):
        say(line)
    say(f"scheme: {out}")


def table(proposal: Proposal) -> str:
    """The positions as a table for people."""
    import pandas as pd

    from accelstudy.basics.units import attitude_unit, to_attitude
    from accelstudy.design.spaces import attitudes

    unit = attitude_unit()
    roll, pitch = to_attitude(attitudes(proposal.directions)).T
    rows = pd.DataFrame(
        {
            "position": range(1, len(roll) + 1),
            f"roll/{unit}": [f"{angle + 0.0:.2f}" for angle in roll.round(2)],
            f"pitch/{unit}": [f"{angle + 0.0:.2f}" for angle in pitch.round(2)],
            f"turn/{unit}": ["" if t != t else f"{t:.0f}" for t in to_attitude(proposal.turns)],
        }
    )
    if axes := proposal.axes:
        rows["turned about"] = axes
    return rows.to_string(index=False)


def summary(proposal: Proposal) -> list[str]:
    """What the design brings, in sentences."""
    from accelstudy.basics.units import (
        angle_note,
        attitude_unit,
        display_unit,
        to_attitude,
        to_display,
    )
    from accelstudy.basics.wording import number
    from accelstudy.proposal.proposal import REFERENCE
    from accelstudy.schemes import get_scheme

    request, unit = proposal.request, display_unit("rad")
    n, m = len(proposal.directions), get_scheme(REFERENCE).n_positions
    robot = f" and robot noise {to_display(request.noise.sigma_angle, 'rad'):.3g} {unit}"
    given = f"noise {to_display(request.noise.sigma_force, 'm/s^2'):.3g} mm/s² per position" + (
        robot if request.task.approach.uses_angles else ""
    )
    tilt = f"{to_attitude(request.tilt_range):.4g} {attitude_unit()}"

    def both(rms: Any) -> str:
        roll, pitch = to_display(rms, "rad")
        return f"roll {roll:.2f} {unit}, pitch {pitch:.2f} {unit}"

    effects = ", the neglected effects included" if request.neglect else ""
    after = f" after {request.after}" if request.after else ""
    lines = [
        "\nturn: angle from the position before; 0 repeats it."
        f"\nExpected rms of leveling for tilts up to {tilt}, with {given}{effects}:",
        f"  these {n} positions{after}: {both(proposal.rms)}",
    ]
    if proposal.placed is not None:
        lines.append(f"  if a hand misses them by 5° (sd per axis): {both(proposal.placed)}")
    reference = proposal.reference
    lines.append(
        f"  the {m} of {REFERENCE}{after}: "
        + (both(reference) if reference is not None else "do not determine the model")
    )
    if sizes := proposal.nameable(proposal.directions):
        there = proposal.nameable(get_scheme(REFERENCE).directions)
        lines.append("Size from which a parameter is found, and told from the other effect:")
        for name, (size, of) in sizes.items():
            here, other = (number(float(to_display(s, of))) for s in (size, there[name][0]))
            lines.append(f"  {name}: {here} {display_unit(of)} ({REFERENCE}: {other})")
    share = 100 * proposal.design.efficiency
    if share == share:
        lines.append(
            f"Efficiency at least {share:.1f} % of the best that any {n} "
            f"allowed positions can reach ({request.chosen.text})."
        )
    lines.append(f"Noise of a leveled reading comes on top. {angle_note()}.")
    return lines
