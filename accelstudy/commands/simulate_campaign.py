"""The command that simulates a campaign."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from typing import Any

import click

from accelstudy.basics.errors import InputError
from accelstudy.basics.progress import stage
from accelstudy.commands.options import (
    EFFECT,
    GROSS_ERROR,
    NOISE_EFFECT,
    PATH,
    SCHEME,
    Sectioned,
    approach_option,
    example,
    force_option,
    model_option,
    quiet_option,
    retired_option,
)

_SECTIONS = {
    "What is written": ("out", "truth_path", "name", "seed"),
    "The sensor": ("model", "effects", "size", "noise_effects", "gross_errors"),
    "Its noise": ("sigma", "sigma_unknown", "robot_sigma_mgon", "n_samples"),
    "The holds": ("scheme", "repeats", "repeat_first", "order", "approach", "yaw"),
    "Their conditions": ("interval", "no_time", "temperature", "temperature_order", "vibration"),
}


@click.command(
    "simulate-campaign",
    cls=Sectioned,
    sections=_SECTIONS,
    epilog=example(
        'accelstudy simulate-campaign --out blind --truth truth.yaml --effect "warm_up(tau=400)"'
    ),
)
@click.option("--out", type=PATH, required=True, help="Folder of the campaign.")
@click.option("--truth", "truth_path", type=PATH, help="YAML file for the truth.")
@click.option("--name", help="Name of the campaign.  [default: that of the folder]")
@click.option("--seed", default=1, show_default=True, help="Seed of all random numbers.")
@click.option(
    "--scheme",
    type=SCHEME,
    default="mclaren-24",
    show_default=True,
    help="Positions; `accelstudy schemes` lists them.",
)
@click.option("--repeats", default=1, show_default=True, help="How often the scheme is measured.")
@click.option(
    "--repeat-first",
    default=0,
    show_default=True,
    help="First holds that are measured again at the end.",
)
@click.option(
    "--order", default="scheme", show_default=True, help="Order of the holds: scheme or random."
)
@approach_option("robot")
@model_option
@click.option(
    "--effect",
    "effects",
    type=EFFECT,
    multiple=True,
    help="An effect beside the model, as 'warm_up(tau=400)' or, with its parameters in SI, "
    "'thermal_bias: 0.004, -0.002, 0.001'.",
)
@click.option(
    "--size",
    default=1.0,
    show_default=True,
    help="Factor of the typical size of each --effect without parameters.",
)
@click.option(
    "--noise-effect",
    "noise_effects",
    type=NOISE_EFFECT,
    multiple=True,
    help="A noise effect, as 'heavy_tails(nu=3)'.",
)
@click.option(
    "--gross",
    "gross_errors",
    type=GROSS_ERROR,
    multiple=True,
    help="A gross error, as 'row_order(first=3, second=4)'.",
)
@click.option("--sigma", default=0.002, show_default=True, help="Sd of a position's mean, m/s².")
@click.option("--sigma-unknown", is_flag=True, help="Leave the noise out of the header.")
@click.option(
    "--robot-sigma-mgon", default=3.2, show_default=True, help="Sd of the robot's angles, mgon."
)
@click.option("--interval", default=60.0, show_default=True, help="Seconds between holds.")
@click.option("--no-time", is_flag=True, help="Leave out the time of the holds.")
@click.option("--temperature", help="First and last temperature, °C, as 20:40.")
@click.option(
    "--temperature-order",
    default="linear",
    show_default=True,
    help="Course of the temperature: linear, ABBA or random.",
)
@click.option("--vibration", help="Lowest and highest rms, m/s², as 0:1.")
@click.option("--yaw", default="none", show_default=True, help="Yaw of the holds: none or random.")
@click.option(
    "--samples-per-hold",
    "n_samples",
    type=int,
    help="Samples of a hold; adds columns on them.",
)
@retired_option("--hold", "campaigns have no slopes within holds")
@force_option
@quiet_option
def simulate_campaign_command(
    out: Path,
    truth_path: Path | None,
    name: str | None,
    sigma_unknown: bool,
    robot_sigma_mgon: float,
    interval: float,
    no_time: bool,
    temperature: str | None,
    vibration: str | None,
    force: bool,
    **options: Any,
) -> None:
    """Simulate a campaign with effects of your choice.

    It can have noise effects and gross errors, too; `accelstudy effects` lists them. What is not
    given is drawn at random. The truth goes to --truth and nowhere else.
    """
    from accelstudy.basics.units import MGON
    from accelstudy.campaign.format import write_campaign
    from accelstudy.campaign.simulated import (
        CampaignSettings,
        simulate_campaign,
        write_truth,
    )
    from accelstudy.files.outputs import CAMPAIGN, new_file, result_folder

    settings = CampaignSettings(
        name=name or out.resolve().name,
        sigma_known=not sigma_unknown,
        sigma_angle=robot_sigma_mgon * MGON,
        interval=None if no_time else interval,
        temperature=_range("temperature", temperature),
        vibration=_range("vibration", vibration),
        **options,
    )
    # The truth enters first and is moved last: it may be meant for a folder that is made here.
    with (
        nullcontext() if truth_path is None else new_file(truth_path, force=force) as truth_file,
        result_folder(out, CAMPAIGN, force=force) as folder,
        stage("simulation"),
    ):
        campaign, truth = simulate_campaign(settings)
        write_campaign(campaign, folder, plausible=not settings.gross_errors)
        if truth_file is not None:
            write_truth(truth, truth_file)
    click.echo(f"campaign: {out} ({campaign.n_positions} positions)")


def _range(option: str, text: str | None) -> tuple[float, float] | None:
    if text is None:
        return None
    try:
        low, high = map(float, text.split(":"))
    except ValueError:
        raise InputError(f"{option}: expected two numbers, as 20:40, not {text!r}") from None
    return low, high
