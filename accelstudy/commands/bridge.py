"""Commands made of verbs: an option for each keyword, with the help of the docstring.

What is of the terminal alone is added here: --out and --force, --angle-unit and --quiet, progress,
and what is printed.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import nullcontext
from glob import glob, has_magic
from importlib import import_module
from pathlib import Path
from typing import Any

import click
from click.shell_completion import CompletionItem

from accelstudy.basics.bounds import Range
from accelstudy.basics.names import check_file_name
from accelstudy.basics.progress import feedback, stage
from accelstudy.basics.units import ANGLE_UNIT_VARIABLE, Given, angles_in
from accelstudy.files.outputs import Kind, result_folder
from accelstudy.verbs import kinds
from accelstudy.verbs.kinds import FileOrFolder, Keyword, Names, Share

Verb = Callable[..., Any]
TERMINAL = ("out", "force", "angle_unit", "quiet")
"""Options that no verb has."""


def command(
    verb: Verb,
    *examples: str,
    name: str = "",
    writes: Kind | None = None,
    out: str = "Folder to write to.",
    optional: bool = False,
    sections: Mapping[str, Sequence[str]] | None = None,
    show: Callable[..., None] = click.echo,
    run: Callable[..., None] | None = None,
    options: Iterable[click.Option] = (),
    angles: bool = True,
) -> click.Command:
    """Make the command of a verb.

    Parameters
    ----------
    verb : function, as `accelstudy.verbs.kinds.verb` makes it
    examples : str, for the end of its help: commands that run as they stand
    name : str, of the command; that of the verb if omitted
    writes : Kind, of the folder that --out names, if the verb has a result with files
    out : str, help of --out
    optional : bool, whether nothing is written without --out
    sections : mapping of a title of the help to names of keywords, in the order of the help
    show : function that prints what the verb returns, where this is not a result with files
    run : function that does all of it, with the verb's parameters and with those of `options`
    options : further options, which come first
    angles : bool, whether it shows angles
    """
    arguments = [p for p in inspect.signature(verb).parameters.values() if _is_argument(p)]
    keywords = kinds.keywords(verb)

    def act(*, quiet: bool, angle_unit: str | None = None, **given: Any) -> None:
        with feedback(quiet), angles_in(angle_unit):
            if run is not None:
                run(**given)
            elif writes is None:
                show(_call(verb, arguments, given))
            else:
                _save(verb, arguments, given, writes)

    own = [_option(one, verb) for one in keywords]
    terminal = [_ANGLE_UNIT, _QUIET] if angles else [_QUIET]
    if writes is not None:
        place = click.Option(["--out"], type=PATH, required=not optional, help=out)
        own = [*own, place] if optional else [place, *own]
        terminal = [_FORCE, *terminal]
    return Command(
        name or str(verb.__name__).replace("_", "-"),
        callback=act,
        params=[*map(_argument, arguments), *options, *own, *terminal],
        help=_spelled(kinds.summary(verb), verb),
        epilog="\n".join(["\b", "Example:", *(f"  {line}" for line in examples)]),
        sections=sections or {},
        meanings={_metavar(one): kinds.meanings(verb)[one.name] for one in arguments},
    )


def _call(verb: Verb, arguments: Sequence[inspect.Parameter], given: dict[str, Any]) -> Any:
    values = [given.pop(one.name) for one in arguments]
    return verb(*values, **given)


def _save(
    verb: Verb, arguments: Sequence[inspect.Parameter], given: dict[str, Any], writes: Kind
) -> None:
    """Call a verb, write its result to --out, and print what it says."""
    out, force = given.pop("out"), given.pop("force")
    named = {one.name for one in kinds.keywords(verb) if getattr(one.kind, "files", False)}
    inputs = [path for value in given.values() for path in _paths(value)]
    inputs += [Path(given[name]) for name in named if isinstance(given[name], str)]
    place = nullcontext() if out is None else result_folder(out, writes, inputs, force)
    with place as folder, stage(writes.name):
        result = _call(verb, arguments, given)
        if result.exit_status:
            result.tell(None)
            raise click.exceptions.Exit(result.exit_status)
        if folder is not None:
            result.write(folder, out)
    result.tell(out)


def _paths(value: Any) -> list[Path]:
    """Paths that were given, those of a pattern included."""
    if isinstance(value, tuple):
        return [path for one in value for path in _paths(one)]
    if not isinstance(value, Path):
        return []
    if has_magic(str(value)) and not value.exists():
        return [Path(path) for path in glob(str(value))]
    return [value]


# --- what click is told ---------------------------------------------------------------------------


class Command(click.Command):
    """A command that says what its arguments are, and has its options in sections.

    Parameters
    ----------
    sections : mapping of title to names of options
    meanings : mapping of argument to its meaning
    """

    def __init__(
        self,
        *args: Any,
        sections: Mapping[str, Sequence[str]],
        meanings: Mapping[str, str],
        **kwargs: Any,
    ) -> None:
        super().__init__(*args, **kwargs)
        self.sections, self.meanings = sections, meanings

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the arguments, the sections, and at the end what is in none of them."""
        options = [p for p in self.get_params(ctx) if isinstance(p, click.Option)]
        rows = {p.name: row for p in options if (row := p.get_help_record(ctx))}
        lists = {"Arguments": [*self.meanings.items()]} if self.meanings else {}
        lists |= {title: [rows.pop(one) for one in own] for title, own in self.sections.items()}
        lists["Other options" if self.sections else "Options"] = list(rows.values())
        for title, records in lists.items():
            with formatter.section(title):
                formatter.write_dl(records)


class Text(click.ParamType):  # type: ignore[type-arg]  # generic from click 8.5 on
    """A text that the verb checks; the shell completes names, and files where one may stand."""

    def __init__(self, kind: Any) -> None:
        self.kind = kind
        self.name = kind.what if isinstance(kind, Names) else type(kind).__name__.lower()

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Names that begin with what was typed; files, if none does."""
        if not isinstance(self.kind, Names):
            return []
        before, plus, last = incomplete.rpartition("+" if self.kind.parts else "\0")
        found = _names(self.kind)
        if plus and self.kind.parts:
            found += _names(self.kind.parts)
        items = [CompletionItem(f"{before}{plus}{one}") for one in found if one.startswith(last)]
        if items or not self.kind.files:
            return items
        return [CompletionItem(incomplete, type="file")]


def _names(kind: Names) -> list[str]:
    names = getattr(import_module(kind.module), kind.names)
    return [*(names() if callable(names) else names)]


class Whole(click.IntRange):
    """A whole number, whose range stands in the help; the verb checks it."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the number, or what is none."""
        try:
            return int(value)
        except ValueError:
            return value


class FilePath(click.Path):
    """A path that a file can have."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Check the name."""
        check_file_name(value)
        return super().convert(value, param, ctx)


PATH = FilePath(path_type=Path)
_QUIET = click.Option(["--quiet"], is_flag=True, help="Print only the result and warnings.")
_FORCE = click.Option(
    ["--force"], is_flag=True, help="Overwrite files of the same names, but never an input."
)
_ANGLE_UNIT = click.Option(
    ["--angle-unit"],
    type=Text(Names("angle_unit", "accelstudy.basics.units", "ANGLE_UNITS")),
    metavar="[gon|deg]",
    help=f"Unit in which angles are shown.  [default: gon, or {ANGLE_UNIT_VARIABLE}]",
)


def _is_argument(parameter: inspect.Parameter) -> bool:
    return parameter.kind is parameter.POSITIONAL_OR_KEYWORD


def _argument(parameter: inspect.Parameter) -> click.Argument:
    """Argument of a positional parameter, which is a path."""
    many = "Sequence" in parameter.annotation
    return click.Argument(
        [parameter.name],
        type=PATH,
        nargs=-1 if many else 1,
        required=True,
        metavar=f"{_metavar(parameter)}..." if many else None,
    )


def _metavar(parameter: inspect.Parameter) -> str:
    many = "Sequence" in parameter.annotation
    return (parameter.name.removesuffix("s") if many else parameter.name).upper()


def _option(keyword: Keyword, verb: Verb) -> click.Option:
    """Option of a keyword."""
    default = None if keyword.default is inspect.Parameter.empty else keyword.default
    return click.Option(
        [f"--{keyword.option.replace('_', '-')}", keyword.name],
        type=_type(keyword.kind),
        is_flag=keyword.kind is bool,
        multiple=keyword.many,
        required=keyword.default is inspect.Parameter.empty,
        default=default,
        show_default=default not in (None, (), False),
        help=_spelled(keyword.help, verb).replace(" [default", "  [default"),
    )


def _type(kind: Any) -> Any:
    match kind:
        case Given():
            text = Text(kind)
            text.name = "quantity"
            return text
        case Names() | Share():
            return Text(kind)
        case Range(least=least, most=most):
            return Whole(int(least), int(most) if most <= 1e6 else None)
        case FileOrFolder():
            return PATH
    return kind


def _spelled(text: str, verb: Verb) -> str:
    """Text of a docstring with the names of keywords as options."""
    options = {one.name: f"--{one.option.replace('_', '-')}" for one in kinds.keywords(verb)}
    return re.sub(r"`(\w+)`", lambda name: options.get(name[1], name[0]), text)
