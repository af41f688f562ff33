"""The command that advises in a running session."""

from __future__ import annotations

import math
import time
from pathlib import Path
from typing import TYPE_CHECKING

import click

from accelstudy.basics.progress import say, show, warn
from accelstudy.commands.options import (
    PATH,
    Quantity,
    Sectioned,
    angle_unit_option,
    approach_option,
    example,
    model_option,
    quiet_option,
)

if TYPE_CHECKING:
    from accelstudy.campaign.of_type import SensorType
    from accelstudy.campaign.session import Campaign
    from accelstudy.sequential.estimate import Prior

POLL = 1.0
"""Seconds between two looks at a growing table."""
TYPES = (".yaml", ".yml")
"""Endings of files of a type."""
SECTIONS = {
    "What is wanted": ("tilt_accuracy", "tilt_range"),
    "The calibration": ("approach", "model", "prior"),
    "Positions to choose from": ("attitudes", "pole_distance", "max_roll", "max_pitch"),
    "The session": ("watch",),
}


@click.command(
    "advise",
    cls=Sectioned,
    sections=SECTIONS,
    epilog=example("accelstudy advise my-campaign --tilt-accuracy 10mgon --tilt-range 30gon"),
)
@click.argument("campaign", type=PATH)
@click.option(
    "--tilt-accuracy",
    type=Quantity("rad", 1e-9, math.pi / 2),
    required=True,
    help="Rms of roll and of pitch to reach, as 10mgon or 0.01deg.",
)
@click.option(
    "--tilt-range",
    type=Quantity("rad", 1e-3, math.pi / 2),
    default="30gon",
    show_default=True,
    help="Largest tilt at which the accuracy is wanted.",
)
@approach_option(None)
@model_option
@click.option(
    "--prior",
    type=PATH,
    help="An earlier calibration.json with the same model, or the type.yaml of a lot.",
)
@click.option(
    "--attitudes",
    help="Attitudes to choose from: cube (faces, edges, corners), grid (roll and pitch in steps of "
    "25 gon) or a CSV file.  [default: cube, with a robot grid]",
)
@click.option(
    "--pole-distance",
    type=Quantity("rad", 0.0, 2.0),
    help="Least angle between the x axis and the vertical.  [default: none]",
)
@click.option(
    "--max-roll", type=Quantity("rad", 0.0, 4.0), help="Largest roll, either way.  [default: any]"
)
@click.option(
    "--max-pitch", type=Quantity("rad", 0.0, 4.0), help="Largest pitch, either way.  [default: any]"
)
@click.option("--watch", is_flag=True, help="Wait for further positions until Ctrl-C.")
@angle_unit_option
@quiet_option
def advise_command(
    campaign: Path,
    tilt_accuracy: float,
    tilt_range: float,
    approach: str | None,
    model: str,
    prior: Path | None,
    attitudes: str | None,
    pole_distance: float | None,
    max_roll: float | None,
    max_pitch: float | None,
    watch: bool,
) -> None:
    """Say in a session where to go next, and when to stop.

    CAMPAIGN is the folder of the session. It has a campaign.yaml; its positions.csv may have few
    positions or none, or be missing still. The positions so far are calibrated and judged as
    `calibrate` does. The command says what is not determined yet, which positions contradict the
    others, and the tilt accuracy so far.

    The accuracy is the rms over all calibrations that could have come out. If the noise is known,
    about half of single ones leave more in roll or in pitch.
    """
    from accelstudy.approaches import get_approach
    from accelstudy.basics.errors import InputError
    from accelstudy.basics.suggested import calibrate
    from accelstudy.campaign.calibration.fit import usual_approach
    from accelstudy.sensors.models import get_model
    from accelstudy.sequential.advisor import advise
    from accelstudy.sequential.choice import DEFAULTS, candidates
    from accelstudy.sequential.promise import Promise
    from accelstudy.sequential.running import Watch, read_as_it_is
    from accelstudy.sequential.wording import heading, lines

    session, promise = Watch(campaign), Promise(tilt_accuracy, tilt_range)
    if watch:
        now = next(session.look())
    else:
        running = read_as_it_is(campaign)
        now = running.campaign
        if running.unfinished:
            warn(f"{campaign}: the last line of the table is not whole; it is not counted")
    equipment = usual_approach(now) if approach is None else get_approach(approach)
    name = equipment.name
    sensor = get_model(model)
    directions = candidates(
        attitudes or DEFAULTS.get(name, "grid"), pole_distance, max_roll, max_pitch
    )
    known = _prior(prior, model)

    def tell(now: Campaign) -> None:
        """Print the advice."""
        advice = advise(now, sensor, equipment, promise, directions, known)
        show(heading(advice, now, sensor, name))
        for line in lines(advice, now, sensor, promise):
            show(f"  {line}")
        if advice.enough:
            of_type = prior if prior and prior.suffix in TYPES else None
            show(f"  calibrate: {calibrate(campaign, model, name, of_type)}")

    for warning in now.warnings:
        warn(warning)
    tell(now)
    if not watch:
        return
    say("\nwaiting for the next position; Ctrl-C ends")
    try:
        while True:
            time.sleep(POLL)
            try:
                sessions = list(session.look())
            except InputError as error:
                click.echo("")
                warn(f"waiting for a whole table: {error}")
                continue
            for now in sessions:
                click.echo("")
                tell(now)
    except KeyboardInterrupt:
        say("\nended")


def _prior(path: Path | None, model: str) -> Prior | SensorType:
    """What an earlier calibration, or a type, says; nothing without one."""
    import numpy as np

    from accelstudy.basics.errors import InputError
    from accelstudy.campaign.calibration.applying import read_calibration
    from accelstudy.campaign.of_type import read_type
    from accelstudy.sensors.models import get_model
    from accelstudy.sequential.estimate import NOTHING_KNOWN, Prior

    if path is None:
        return NOTHING_KNOWN
    wanted = get_model(model)
    if path.suffix in TYPES:
        return read_type(path, wanted)
    earlier = read_calibration(path)
    if earlier.model.parameter_names != wanted.parameter_names:
        raise InputError(
            f"{path}: calibrates {', '.join(earlier.model.parameter_names)}, but the model "
            f"{wanted.name!r} has {', '.join(wanted.parameter_names)}"
        )
    if not np.isfinite(earlier.covariance).all():
        raise InputError(f"{path}: does not say how well its parameters are known")
    return Prior.of_covariance(earlier.parameters, earlier.covariance)
