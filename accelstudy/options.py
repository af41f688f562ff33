"""Options that several commands share, worded once."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import wraps
from pathlib import Path
from typing import Any, TypeVar

import click
from click.shell_completion import CompletionItem

from accelstudy.progress import feedback
from accelstudy.units import ANGLE_UNITS, angles_in

PATH = click.Path(path_type=Path)
Command = TypeVar("Command", bound=Callable[..., Any])


class Name(click.ParamType):  # type: ignore[type-arg]  # generic from click 8.5 on
    """A name that the shell completes; whether there is such a thing, the registry says.

    Parameters
    ----------
    what : str
        What is named.
    known : callable
        Gives the names that there are; called when the shell asks only.
    """

    def __init__(self, what: str, known: Callable[[], Iterable[str]]) -> None:
        self.name = what
        self.known = known

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Names that begin with what was typed."""
        return [CompletionItem(name) for name in self.known() if name.startswith(incomplete)]


ANGLE_UNIT = Name("angle unit", lambda: ANGLE_UNITS)

force_option = click.option(
    "--force",
    is_flag=True,
    help="Replace files of the same names, where there are any; never an input.",
)


def angle_unit_option(command: Command) -> Command:
    """Add --angle-unit to a command that shows angles."""

    @click.option(
        "--angle-unit",
        type=ANGLE_UNIT,
        metavar="[gon|deg]",
        help="Unit of angles, gon or deg.  [default: gon, or ACCELSTUDY_ANGLE_UNIT]",
    )
    @wraps(command)
    def within(*args: Any, angle_unit: str | None, **kwargs: Any) -> Any:
        with angles_in(angle_unit):
            return command(*args, **kwargs)

    return within  # type: ignore[return-value]


def quiet_option(command: Command) -> Command:
    """Add --quiet to a command that tells what it does, and show its progress."""

    @click.option("--quiet", is_flag=True, help="Show no progress and print only warnings.")
    @wraps(command)
    def within(*args: Any, quiet: bool, **kwargs: Any) -> Any:
        with feedback(quiet):
            return command(*args, **kwargs)

    return within  # type: ignore[return-value]
