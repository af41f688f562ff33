"""The command that plans a calibration."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from accelstudy.basics.progress import begin, say
from accelstudy.commands.options import (
    PATH,
    SCHEME,
    Name,
    Sectioned,
    angle_unit_option,
    example,
    force_option,
    history_option,
    quantity_option,
    quiet_option,
    seed_option,
)
from accelstudy.planning.quantities import MOST_POSITIONS, QUANTITIES, REPLICATES

NOT_REACHED = 1
"""Exit status where no calibration reaches the target."""


class Confidence(click.ParamType):  # type: ignore[type-arg]
    """A share of the calibrations, ``95%`` or ``0.95``, or ``rms``."""

    name = "confidence"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float | None:
        """Share, or None for the rms."""
        from accelstudy.planning.question import confidence_of

        return value if value is None else confidence_of(str(value).strip())


_SECTIONS = {
    "What is asked": (
        "tilt_accuracy",
        "tilt_range",
        "sensor",
        "sigma",
        "history",
        "equipment",
        "reference",
        "confidence",
    ),
    "What is tried": ("holds", "schemes", "max_time", "max_positions", "replicates", "seed"),
    "What the equipment takes": (
        "moving_time",
        "robot_moving_time",
        "robot_setup_time",
        "robot_accuracy",
    ),
}


@click.command(
    "plan",
    cls=Sectioned,
    sections=_SECTIONS,
    epilog=example("accelstudy plan --tilt-accuracy 10mgon --tilt-range 30gon --sigma 2mm/s2"),
)
@quantity_option("tilt_accuracy", QUANTITIES["tilt_accuracy"], required=True)
@quantity_option("tilt_range", QUANTITIES["tilt_range"])
@click.option(
    "--sensor",
    type=Name("sensor", "accelstudy.data_sheets", "data_sheet_names"),
    help="A data sheet that comes with accelstudy, a YAML file like it, or the folder of a "
    "campaign.",
)
@quantity_option("sigma", QUANTITIES["sigma"])
@history_option
@click.option(
    "--equipment",
    type=click.Choice(["gravity", "robot", "both"]),
    default="both",
    show_default=True,
    help="Positions by hand, with gravity alone, or with a robot that tells roll and pitch.",
)
@click.option(
    "--reference",
    help="Compare with a calibrated sensor beside it, too: its calibration.json, or alike, for one "
    "of the same type.",
)
@click.option(
    "--confidence",
    type=Confidence(),
    default="rms",
    show_default=True,
    help="What must reach the accuracy: the rms, or both angles in so many calibrations, as 95%.",
)
@quantity_option("hold", QUANTITIES["hold"], "holds", multiple=True)
@click.option(
    "--scheme",
    "schemes",
    type=SCHEME,
    multiple=True,
    help="One more to compare: a name, or a file of `accelstudy design`; may be repeated.",
)
@quantity_option("max_time", QUANTITIES["max_time"])
@click.option(
    "--max-positions",
    type=click.IntRange(*MOST_POSITIONS),
    default=200,
    show_default=True,
    help="Largest number of positions.",
)
@quantity_option("moving_time", QUANTITIES["moving_time"])
@quantity_option("robot_moving_time", QUANTITIES["robot_moving_time"])
@quantity_option("robot_setup_time", QUANTITIES["robot_setup_time"])
@quantity_option("robot_accuracy", QUANTITIES["robot_accuracy"])
@click.option(
    "--replicates",
    type=click.IntRange(*REPLICATES),
    default=200,
    show_default=True,
    help="Simulated calibrations of each candidate at the top.",
)
@seed_option
@click.option("--out", type=PATH, help="Folder for the table, the figure and a study.")
@force_option
@angle_unit_option
@quiet_option
def plan_command(
    sensor: str | None,
    history: Path | None,
    replicates: int,
    seed: int,
    out: Path | None,
    force: bool,
    **asked: Any,
) -> None:
    """Find the cheapest calibration for a tilt accuracy.

    The command compares models, schemes, numbers of positions and durations by linear theory, and
    simulates those at the top. The sensor is --sensor or, if only its noise is known, --sigma. If
    nothing reaches the accuracy, one line says what would be reachable, and the exit status is 1.
    """
    from accelstudy.planning.question import question_of

    question = question_of(sensor=sensor, **asked)
    if history is not None:
        from accelstudy.data_sheets.measured import with_history

        question = replace(question, sheet=with_history(question.sheet, history))
    begin("comparing calibrations, which takes some seconds ...")
    from accelstudy.planning.answer import answer
    from accelstudy.planning.wording import (
        answer_lines,
        assumption_lines,
        how_to,
        reason_lines,
        table_lines,
        unreachable,
    )

    plan = answer(question, seed, replicates)
    if not plan.ranked:
        click.echo(unreachable(plan))
        raise click.exceptions.Exit(NOT_REACHED)
    for line in (*answer_lines(plan), "", *how_to(plan)):
        click.echo(line)
    for line in ("", *table_lines(plan), "", *reason_lines(plan)):
        say(line)
    for line in ("", *assumption_lines(question)):
        say(line)
    if out is not None:
        from accelstudy.basics.suggested import study_again
        from accelstudy.planning.output import write_plan

        given = [Path(sensor)] if sensor is not None and Path(sensor).exists() else []
        inputs = [*given, *([] if history is None else [history])]
        write_plan(plan, out, {"config_hash": None, "seed": seed}, inputs, force)
        say(f"\nplan, table and figure: {out}")
        say(f"the same numbers again: {study_again(out / 'study.yaml')}")
    else:
        say("\n--out FOLDER keeps the table, the figure, and a study that makes the numbers again.")
