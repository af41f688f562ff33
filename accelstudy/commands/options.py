"""Options that several commands share, worded once."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import wraps
from importlib import import_module
from pathlib import Path
from typing import Any, TypeVar

import click
from click.shell_completion import CompletionItem

from accelstudy.basics.errors import InputError
from accelstudy.basics.names import check_file_name
from accelstudy.basics.progress import feedback
from accelstudy.basics.units import ANGLE_UNIT_VARIABLE, angles_in, parse_quantity


class _Path(click.Path):
    """A path that a file can have."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Check the name."""
        check_file_name(value)
        return super().convert(value, param, ctx)


PATH = _Path(path_type=Path)
Command = TypeVar("Command", bound=Callable[..., Any])


class Name(click.ParamType):  # type: ignore[type-arg]  # generic from click 8.5 on
    """A name that the shell completes; whether there is such a thing, its registry says.

    Parameters
    ----------
    what : str
        What is named.
    module, names : str
        Where the names are: a collection, or a function that returns one. It is imported when the
        shell asks, and not to run a command.
    """

    def __init__(self, what: str, module: str, names: str) -> None:
        self.name = what
        self.module, self.names = module, names

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Names that begin with what was typed."""
        names = getattr(import_module(self.module), self.names)
        choices = names() if callable(names) else names
        return [CompletionItem(name) for name in choices if name.startswith(incomplete)]


class ModelName(Name):
    """A model: a name, a composition, of which the shell completes the last part, or a file."""

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Models and, after a +, effects; files if no name begins with what was typed."""
        before, plus, last = incomplete.rpartition("+")
        completions = super().shell_complete(ctx, param, last)
        if plus:
            completions += EFFECT.shell_complete(ctx, param, last)
        items = [CompletionItem(f"{before}{plus}{item.value}") for item in completions]
        return items or [CompletionItem(incomplete, type="file")]


class Quantity(click.ParamType):  # type: ignore[type-arg]
    """A number with its unit, as 10mgon or 0.01deg; the command gets it in SI.

    Parameters
    ----------
    unit : str, SI unit, one of `accelstudy.basics.units.UNITS`
    least, most : float, SI, both allowed
    """

    name = "quantity"

    def __init__(self, unit: str, least: float = 0.0, most: float = math.inf) -> None:
        self.unit, self.least, self.most = unit, least, most

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """Value in SI; raises `InputError` if it is none, or out of bounds."""
        if not isinstance(value, str):
            return float(value)
        try:
            return parse_quantity(value, self.unit, self.least, self.most)
        except InputError as error:
            raise InputError(f"{param.opts[0]}: {error}" if param else str(error)) from None


class SchemeName(Name):
    """A scheme: a name, or a file, of which the shell completes paths if no name fits."""

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Schemes, or files if no name begins with what was typed."""
        completions = super().shell_complete(ctx, param, incomplete)
        return completions or [CompletionItem(incomplete, type="file")]


ANGLE_UNIT = Name("angle_unit", "accelstudy.basics.units", "ANGLE_UNITS")
APPROACH = Name("approach", "accelstudy.approaches", "approach_names")
EFFECT = Name("effect", "accelstudy.effects", "effect_names")
GROSS_ERROR = Name("gross_error", "accelstudy.campaign.gross_errors", "gross_error_names")
MODEL = ModelName("model", "accelstudy.sensors.models", "MODELS")
NOISE_EFFECT = Name("noise_effect", "accelstudy.noise_effects", "noise_effect_names")
SCHEME = SchemeName("scheme", "accelstudy.schemes", "scheme_names")
SENSOR = Name("sensor", "accelstudy.data_sheets", "data_sheet_names")

model_option = click.option(
    "--model",
    type=MODEL,
    default="bias-scale-nonorthogonality",
    show_default=True,
    help="A model: one that `accelstudy models` lists, a composition, or a YAML file.",
)


def retired_option(
    name: str, instead: str, *, is_flag: bool = False
) -> Callable[[Command], Command]:
    """Add an option of earlier versions, which ends in a line that says what to do instead."""

    def refuse(context: click.Context, option: click.Parameter, value: str | bool | None) -> None:
        if value:
            raise InputError(f"{name}: no longer an option; {instead}")

    return click.option(
        name, is_flag=is_flag, hidden=True, expose_value=False, callback=refuse, help="Retired."
    )


def approach_option(default: str | None) -> Callable[[Command], Command]:
    """Add --approach; without a default the command takes the robot if the campaign has one."""
    words = "" if default else "  [default: robot, if the campaign has its angles]"
    return click.option(
        "--approach",
        type=APPROACH,
        default=default,
        show_default=bool(default),
        help=f"Calibrate by gravity alone, or with the angles of a robot, too.{words}",
    )


force_option = click.option(
    "--force",
    is_flag=True,
    help="Overwrite files of the same names, but never an input.",
)


def angle_unit_option(command: Command) -> Command:
    """Add --angle-unit to a command that shows angles."""

    @click.option(
        "--angle-unit",
        type=ANGLE_UNIT,
        metavar="[gon|deg]",
        help=f"Unit in which angles are shown.  [default: gon, or {ANGLE_UNIT_VARIABLE}]",
    )
    @wraps(command)
    def within(*args: Any, angle_unit: str | None, **kwargs: Any) -> Any:
        with angles_in(angle_unit):
            return command(*args, **kwargs)

    return within  # type: ignore[return-value]


def quiet_option(command: Command) -> Command:
    """Add --quiet to a command that tells what it does, and show its progress."""

    @click.option(
        "--quiet",
        is_flag=True,
        help="Print only the result and warnings.",
    )
    @wraps(command)
    def within(*args: Any, quiet: bool, **kwargs: Any) -> Any:
        with feedback(quiet):
            return command(*args, **kwargs)

    return within  # type: ignore[return-value]


def plugin_option(**options: Any) -> Callable[[Command], Command]:
    """Add --plugin; the files are loaded before anything else of the command is looked at."""

    def load(ctx: click.Context, param: click.Parameter, paths: tuple[Path, ...]) -> None:
        if paths and not ctx.resilient_parsing:
            from accelstudy.basics.plugins import load_files

            load_files(paths)

    return click.option(
        "--plugin",
        type=PATH,
        multiple=True,
        expose_value=False,
        callback=load,
        help="Python file with effects, schemes and the like of your own; it may also be named "
        "after the command.",
        **options,
    )


def log_options(command: Command) -> Command:
    """Add the options that say how the numbers of a log are read, in the order of the help."""
    for name, help_text in {
        "--scale": "For counts: m/s² per count, one number or three.",
        "--unit": "Unit of the readings: m/s^2, g, mg or counts.  [default: as named, or m/s^2]",
        "--variable": "Array of a MATLAB file, topic of a bag or instance of a ULog.",
        "--delimiter": "Between columns of text: ; or tab or blank.  [default: from its rows]",
        "--rate": "Samples per second, where there is no time.",
        "--time-unit": "Unit of the time: s, ms, us or ns.  [default: as named, or s]",
        "--time": "Column of the time, by name or number.",
        "--columns": "Columns by name, or by number from 0: fx=1,fy=2,fz=3.",
    }.items():
        of_type = float if name == "--rate" else str
        command = click.option(name, type=of_type, help=help_text)(command)
    return command


seed_option = click.option(
    "--seed",
    default=1,
    show_default=True,
    type=click.IntRange(min=0),
    help="Seed of all random numbers.",
)


class Sectioned(click.Command):
    """A command with many options, which its help lists in sections.

    Parameters
    ----------
    sections : mapping of title to names of the options, as the command's function has them
    """

    def __init__(self, *args: Any, sections: Mapping[str, Sequence[str]], **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.sections = sections

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the sections, and what is in none of them at the end."""
        options = [p for p in self.get_params(ctx) if isinstance(p, click.Option)]
        rows = {p.name: row for p in options if (row := p.get_help_record(ctx))}
        sections = {
            title: [rows.pop(name) for name in names] for title, names in self.sections.items()
        }
        for title, records in (*sections.items(), ("Other options", list(rows.values()))):
            with formatter.section(title):
                formatter.write_dl(records)


def example(*commands: str) -> str:
    """Epilog of a help text: commands that run as they stand, one after the other."""
    return "\n".join(["\b", "Example:", *(f"  {command}" for command in commands)])
