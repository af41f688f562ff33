"""Commands made of verbs: an option for each keyword, with the help of the docstring.

What is of the terminal alone is added here: --out and --force, --angle-unit and --quiet, progress,
and what is printed. cyclopts reads signatures and docstrings, too, but takes 0.2 s longer for
`--help`, and shows defaults of quantities in SI and errors in boxes.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import nullcontext
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import Any, Literal

import click
from click.shell_completion import CompletionItem

from accelstudy.basics.bounds import Range
from accelstudy.basics.errors import OPTIONS, InputError
from accelstudy.basics.names import check_file_name
from accelstudy.basics.progress import feedback, stage
from accelstudy.basics.units import ANGLE_UNIT_VARIABLE, angles_in
from accelstudy.files.outputs import Kind, result_folder
from accelstudy.verbs import kinds
from accelstudy.verbs.kinds import FileOrFolder, Keyword, Names

Verb = Callable[..., Any]


def command(
    verb: Verb,
    *examples: str,
    name: str = "",
    writes: Kind | Literal["file"] | None = None,
    out: str = "Folder to write to.",
    optional: bool = False,
    more: str = "",
    sections: Mapping[str, str] | None = None,
    reads: Callable[[Any], Iterable[Any]] = lambda given: (),
    show: Callable[..., None] = click.echo,
    run: Callable[..., None] | None = None,
    options: Iterable[click.Option] = (),
    retired: Mapping[str, str] | None = None,
    angles: bool = True,
    quiet: bool = True,
) -> click.Command:
    """Make the command of a verb.

    Parameters
    ----------
    verb : function, as `accelstudy.verbs.kinds.verb` makes it
    examples : str, for the end of its help: commands that run as they stand
    name : str, of the command; that of the verb if omitted
    writes : Kind, of the folder that --out names, if the verb has a result with files; "file" for
        one file, which `run` writes
    out : str, help of --out
    optional : bool, whether nothing is written without --out
    more : str, what its help says of `options` and of files, beside the docstring
    sections : mapping of a title of the help to names of options, in the order of the help
    reads : function, what else is read of a path that is given, such as those of a pattern
    show : function that prints what the verb returns, where this is not a result with files
    run : function that does all of it, with the verb's parameters, --out and --force, and with
        those of `options`
    options : further options, which come after that of --out
    retired : mapping of an option of earlier versions to what to do instead; of a flag it ends in !
    angles, quiet : bool, whether it shows angles, and more than its result
    """
    arguments = [p for p in inspect.signature(verb).parameters.values() if _is_argument(p)]

    def act(*, quiet: bool = False, angle_unit: str | None = None, **given: Any) -> None:
        with feedback(quiet), angles_in(angle_unit):
            if run is not None:
                run(**given)
            elif isinstance(writes, Kind):
                _save(verb, arguments, given, writes, reads)
            elif (result := _call(verb, arguments, given)) is not None:
                show(result)

    def parameters() -> Iterator[click.Parameter]:
        yield from (_argument(one, verb) for one in arguments)
        place = click.Option(["--out"], type=PATH, required=not optional, help=out)
        if writes is not None and not optional:
            yield place
        yield from options
        yield from (_option(one, verb) for one in kinds.keywords(verb))
        if writes is not None:
            yield from (place, _FORCE) if optional else (_FORCE,)
        yield from (one for one, wanted in ((_ANGLE_UNIT, angles), (_QUIET, quiet)) if wanted)
        yield from (_retired(*item) for item in {**_renamed(verb), **(retired or {})}.items())
        # It stands in the help of all commands together.
        yield click.Option(["--plugin"], hidden=True, **PLUGIN)

    return Command(
        name or str(verb.__name__).replace("_", "-"),
        parameters,
        callback=act,
        help="\n\n".join(filter(None, [_spelled(kinds.summary(verb), verb), more])),
        epilog="\n".join(["\b", "Example:", *(f"  {line}" for line in examples)]),
        sections={title: names.split() for title, names in (sections or {}).items()},
        meanings=lambda: {_metavar(one): kinds.meanings(verb)[one.name] for one in arguments},
    )


def _call(verb: Verb, arguments: Sequence[inspect.Parameter], given: dict[str, Any]) -> Any:
    values = [given.pop(one.name) for one in arguments]
    return verb(*values, **given)


def _save(
    verb: Verb,
    arguments: Sequence[inspect.Parameter],
    given: dict[str, Any],
    writes: Kind,
    reads: Callable[[Any], Iterable[Any]],
) -> None:
    """Call a verb, write its result to --out, and print what it says."""
    out, force = given.pop("out"), given.pop("force")
    paths = [path for one in arguments for path in _paths(given[one.name])]
    inputs = [*inputs_of(verb, given), *(each for path in paths for each in reads(path))]
    place = nullcontext() if out is None else result_folder(out, writes, inputs, force)
    with place as folder, stage(writes.name):
        result = _call(verb, arguments, given)
        if result.exit_status:
            result.tell(None)
            raise click.exceptions.Exit(result.exit_status)
        if folder is not None:
            result.write(folder, out)
    result.tell(out)


def inputs_of(verb: Verb, given: Mapping[str, Any]) -> list[Path]:
    """Files and folders that a verb reads."""
    named = {one.name for one in kinds.keywords(verb) if getattr(one.kind, "files", False)}
    inputs = [path for value in given.values() for path in _paths(value)]
    return inputs + [Path(given[name]) for name in named if isinstance(given[name], str)]


def _paths(value: Any) -> list[Path]:
    """Paths that were given."""
    if isinstance(value, tuple):
        return [path for one in value for path in _paths(one)]
    return [value] if isinstance(value, Path) else []


# --- what click is told ---------------------------------------------------------------------------


class Command(click.Command):
    """A command that says what its arguments are, and has its options in sections.

    Parameters
    ----------
    name : str
    parameters : function that makes its options and arguments, when they are first asked for
    sections : mapping of title to names of options
    meanings : function that returns the meaning of each argument
    """

    def __init__(
        self,
        name: str,
        parameters: Callable[[], Iterable[click.Parameter]],
        *,
        sections: Mapping[str, Sequence[str]],
        meanings: Callable[[], Mapping[str, str]],
        **kwargs: Any,
    ) -> None:
        super().__init__(name, **kwargs)
        del self.params  # the list of all commands does without them
        self._parameters, self.sections, self.meanings = parameters, sections, meanings

    @cached_property
    def params(self) -> list[click.Parameter]:  # type: ignore[override]
        """Options and arguments."""
        return [*self._parameters()]

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command; messages call keywords by its options."""
        options = (p for p in self.params if isinstance(p, click.Option))
        token = OPTIONS.set({str(p.name): p.opts[0] for p in options})
        try:
            return super().invoke(ctx)
        finally:
            OPTIONS.reset(token)

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the arguments, the sections, and at the end what is in none of them."""
        options = [p for p in self.get_params(ctx) if isinstance(p, click.Option)]
        rows = {p.name: row for p in options if (row := p.get_help_record(ctx))}
        meanings = self.meanings()
        lists = {"Arguments": [*meanings.items()]} if meanings else {}
        lists |= {title: [rows.pop(one) for one in own] for title, own in self.sections.items()}
        lists["Other options" if self.sections else "Options"] = list(rows.values())
        for title, records in lists.items():
            with formatter.section(title):
                formatter.write_dl(records)


METAVARS = {"given": "quantity", "word": "text", "place": "column", "pairs": "columns"}
"""What the help calls a value of a kind that has another name."""


class Text(click.ParamType):  # type: ignore[type-arg]  # generic from click 8.5 on
    """A text that the verb checks; the shell completes names, and files where one may stand."""

    def __init__(self, kind: Any) -> None:
        self.kind = kind
        usual = type(kind).__name__.lower()
        self.name = kind.what if isinstance(kind, Names) else METAVARS.get(usual, usual)

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
ANGLE_UNITS = Text(Names("angle_unit", "accelstudy.basics.units", "ANGLE_UNITS"))
_ANGLE_UNIT = click.Option(
    ["--angle-unit"],
    type=ANGLE_UNITS,
    metavar="[gon|deg]",
    help=f"Unit in which angles are shown.  [default: gon, or {ANGLE_UNIT_VARIABLE}]",
)


def _load(ctx: click.Context, param: click.Parameter, paths: tuple[Path, ...]) -> None:
    """Load files of plug-ins, before anything else of the command is looked at."""
    if paths and not ctx.resilient_parsing:
        from accelstudy.basics.plugins import load_files

        load_files(paths)


PLUGIN: dict[str, Any] = {
    "type": PATH,
    "multiple": True,
    "expose_value": False,
    "callback": _load,
    "help": "Python file with effects, schemes and the like of your own; it may also be named "
    "after the command.",
}
"""The option of all commands, before their name and after it."""


def _is_argument(parameter: inspect.Parameter) -> bool:
    return parameter.kind is parameter.POSITIONAL_OR_KEYWORD


def _argument(parameter: inspect.Parameter, verb: Verb) -> click.Argument:
    """Argument of a positional parameter: a path or a name."""
    many = "Sequence" in parameter.annotation
    return click.Argument(
        [parameter.name],
        type=PATH if "Path" in parameter.annotation else _type(kinds.keyword(verb, parameter).kind),
        nargs=-1 if many else 1,
        required=parameter.default is parameter.empty,
        metavar=f"{_metavar(parameter)}..." if many else None,
    )


def _metavar(parameter: inspect.Parameter) -> str:
    many = "Sequence" in parameter.annotation
    return (parameter.name.removesuffix("s") if many else parameter.name).upper()


def _option(keyword: Keyword, verb: Verb) -> click.Option:
    """Option of a keyword."""
    needed = keyword.default is inspect.Parameter.empty
    default = None if needed else keyword.default
    name = keyword.option.replace("_", "-")
    return click.Option(
        [f"--{name}/--no-{name}" if default is True else f"--{name}", keyword.name],
        type=_type(keyword.kind),
        is_flag=keyword.kind is bool,
        nargs=2 if keyword.ends else 1,
        multiple=keyword.many,
        required=needed,
        default=default,
        show_default=default is not False and default not in (None, ()),
        help=_spelled(kinds.meanings(verb)[keyword.name], verb).replace(" [default", "  [default"),
    )


def _renamed(verb: Verb) -> dict[str, str]:
    """Options of earlier versions whose keywords have another name, with what to do instead."""
    names = {one.name for one in kinds.keywords(verb)}
    renamed = [each for each in kinds.RENAMED.items() if each[1] in names]
    spelled = ([f"--{name.replace('_', '-')}" for name in each] for each in renamed)
    return {old: f"{new} takes it" for old, new in spelled}


def _retired(name: str, instead: str) -> click.Option:
    """Option of earlier versions, which ends in a line that says what to do instead."""
    name, flag, _ = name.partition("!")

    def refuse(context: click.Context, option: click.Parameter, value: Any) -> None:
        if value:
            raise InputError(f"{name}: no longer an option; {instead}")

    return click.Option(
        [name],
        is_flag=bool(flag),
        hidden=True,
        expose_value=False,
        callback=refuse,
        help="Retired.",
    )


def _type(kind: Any) -> Any:
    match kind:
        case Range(least=least, most=most):
            return Whole(int(least), int(most) if most <= 1e6 else None)
        case FileOrFolder():
            return PATH
    return kind if isinstance(kind, type) else Text(kind)


def _spelled(text: str, verb: Verb) -> str:
    """Text of a docstring with the names of keywords as options."""
    if "`" not in text:
        return text
    options = {
        name: f"--{kinds.option_of(name, 'Sequence' in one.annotation).replace('_', '-')}"
        for name, one in inspect.signature(verb).parameters.items()
        if not _is_argument(one)
    }
    return re.sub(r"`(\w+)`", lambda name: options.get(name[1], name[0]), text)
