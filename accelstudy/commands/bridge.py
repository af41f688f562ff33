"""Commands made of verbs: an option for each keyword, with the help of the docstring.

What is of the terminal alone is added here: --out and --force, --angle-unit and --quiet, progress,
and what is printed. cyclopts reads signatures and docstrings, too, but takes 0.2 s longer for
`--help`, and shows defaults of quantities in SI and errors in boxes.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterable, Mapping
from contextlib import AbstractContextManager, nullcontext
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import click

from accelstudy.basics.errors import OPTIONS, InputError
from accelstudy.basics.progress import feedback, stage
from accelstudy.basics.units import ANGLE_UNIT_VARIABLE, angles_in
from accelstudy.files.outputs import OutputKind, result_folder
from accelstudy.verbs import kinds
from accelstudy.verbs.kinds import PATH, Names

Place = Callable[..., AbstractContextManager[Path]]
"""Where a result is written: called with the path, and with `inputs` and `force`."""


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
ANGLE_UNITS = Names("angle_unit", "accelstudy.basics.units", "ANGLE_UNITS")
ANGLE_UNIT = click.Option(
    ["--angle-unit"],
    type=ANGLE_UNITS,
    metavar="[gon|deg]",
    help=f"Unit in which angles are shown.  [default: gon, or {ANGLE_UNIT_VARIABLE}]",
)
QUIET = click.Option(["--quiet"], is_flag=True, help="Print only the result and warnings.")
FORCE = click.Option(
    ["--force"], is_flag=True, help="Overwrite files of the same names, but never an input."
)


class Command(click.Command):
    """The command of a verb, which says what its arguments are, and has its options in sections.

    Parameters
    ----------
    verb : function, as `accelstudy.verbs.kinds.verb` makes it
    run : function that does all of it, with the verb's parameters, which are checked, and with
        those of further options; by default `make`, whose result is written to --out if it has
        files
    make : function that returns what is written, with the verb's parameters; by default the verb
    name : str, of the command; that of the verb if omitted
    writes : Kind of the folder that --out names; of a result that is a file, a context manager as
        `accelstudy.files.outputs.new_file`
    out : str, help of --out
    optional : bool, whether nothing is written without --out
    more : str, what its help says of `options` and of files, beside the docstring
    sections : mapping of a title of the help to names of options, in the order of the help
    reads : function, what else is read of a path that is given, such as those of a pattern
    options : further options, which come after that of --out
    retired : mapping of an option of earlier versions to what to do instead
    shared : options of many commands, which come last
    """

    def __init__(
        self,
        verb: Callable[..., Any],
        run: Callable[..., None] | None = None,
        *,
        make: Callable[..., Any] | None = None,
        name: str = "",
        writes: OutputKind | Place | None = None,
        out: str = "Folder to write to.",
        optional: bool = False,
        more: str = "",
        sections: Mapping[str, str] | None = None,
        reads: Callable[[Any], Iterable[Any]] = lambda given: (),
        options: Iterable[click.Option] = (),
        retired: Mapping[str, str] | None = None,
        shared: Iterable[click.Option] = (ANGLE_UNIT, QUIET),
    ) -> None:
        self.verb, self.writes, self.reads = verb, writes, reads
        place = partial(result_folder, kind=writes) if isinstance(writes, OutputKind) else writes
        self.make = make or inspect.unwrap(verb)
        self.run = run or (partial(self._save, place) if place else self.make)
        self.sections = {title: names.split() for title, names in (sections or {}).items()}
        signature = inspect.signature(verb).parameters.values()
        self.arguments = [p for p in signature if p.kind is p.POSITIONAL_OR_KEYWORD]
        super().__init__(
            name or str(verb.__name__).replace("_", "-"),
            callback=self._act,
            help="\n\n".join(filter(None, [self._spelled(kinds.summary(verb)), more])),
            epilog="\n".join(["\b", "Example:", *(f"  {line}" for line in kinds.examples(verb))]),
        )
        del self.params  # the list of all commands does without them
        self._options = optional, out, [*options], [*shared]
        self._retired = dict(retired or {})

    @cached_property
    def params(self) -> list[click.Parameter]:  # type: ignore[override]
        """Options and arguments."""
        optional, out, options, shared = self._options
        place = click.Option(["--out"], type=PATH, required=not optional, help=out)
        first, last = ([], []) if self.writes is None else ([place], [FORCE])
        # It stands in the help of all commands together.
        plugin = click.Option(["--plugin"], hidden=True, **PLUGIN)
        keywords = map(self._option, kinds.keywords(self.verb).values())
        arguments = map(self._argument, self.arguments)
        return [*arguments, *first, *options, *keywords, *last, *shared, plugin]

    def _argument(self, parameter: inspect.Parameter) -> click.Argument:
        """Argument of a positional parameter: a path or a name."""
        path, many = (word in parameter.annotation for word in ("Path", "Sequence"))
        return click.Argument(
            [parameter.name],
            type=PATH if path else kinds.Keyword.of(self.verb, parameter).kind,
            nargs=-1 if many else 1,
            required=parameter.default is parameter.empty,
            metavar=f"{_metavar(parameter)}..." if many else None,
        )

    def _option(self, keyword: kinds.Keyword) -> click.Option:
        """Option of a keyword."""
        needed = keyword.default is inspect.Parameter.empty
        default = keyword.default
        name, meaning = keyword.option, kinds.meanings(self.verb)[keyword.name]
        flag = keyword.kind is kinds.FLAG
        return click.Option(
            [f"{name}/--no-{name[2:]}" if default is True else name, keyword.name],
            type=bool if flag else keyword.kind,
            is_flag=flag,
            nargs=2 if keyword.ends else 1,
            multiple=keyword.many,
            required=needed,
            show_default=not needed and default is not False and default not in (None, ()),
            help=self._spelled(meaning).replace(" [default", "  [default"),
            **({} if needed else {"default": default}),  # None would be a default as well
        )

    def _spelled(self, text: str) -> str:
        """Text of a docstring with the names of keywords as options."""
        if "`" not in text:
            return text
        keywords = kinds.keywords(self.verb)
        options = {name: one.option for name, one in keywords.items()}
        return re.sub(r"`(\w+)`", lambda name: options.get(name[1], name[0]), text)

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Read the options, by whose names messages call keywords from now on."""
        options = (p for p in self.params if isinstance(p, click.Option))
        OPTIONS.set({str(p.name): p.opts[0] for p in options})
        try:
            return super().parse_args(ctx, args)
        except click.NoSuchOption as error:
            keywords = kinds.keywords(self.verb)
            retired = self._retired | {
                f"--{old.replace('_', '-')}": f"{keywords[new].option} takes it"
                for old, new in kinds.RENAMED.items()
                if new in keywords
            }
            if error.option_name not in retired:
                raise
            instead = retired[error.option_name]
            raise InputError(f"{error.option_name}: no longer an option; {instead}") from None

    def _act(self, *, quiet: bool = False, angle_unit: str | None = None, **given: Any) -> None:
        with feedback(quiet), angles_in(angle_unit):
            self.run(**kinds.check(self.verb, given))

    def _save(self, place: Place, *, out: Path | None, force: bool, **given: Any) -> None:
        """Write the result to --out, and print what it says."""
        named = [path for one in self.arguments for path in _paths(given[one.name])]
        read = [one for path in named for one in self.reads(path)]
        inputs = [*inputs_of(self.verb, given), *read]
        opened = nullcontext() if out is None else place(out, inputs=inputs, force=force)
        work = stage(self.writes.name) if isinstance(self.writes, OutputKind) else nullcontext()
        with opened as part, work:
            result = self.make(**given)
            if status := getattr(result, "exit_status", 0):
                result.tell(None)
                raise click.exceptions.Exit(status)
            if part is not None:
                result.write(part, out)
        result.tell(out)

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the arguments, the sections, and at the end what is in none of them."""
        options = [p for p in self.get_params(ctx) if isinstance(p, click.Option)]
        rows = {p.name: row for p in options if (row := p.get_help_record(ctx))}
        meanings = kinds.meanings(self.verb)
        lists = {"Arguments": [(_metavar(one), meanings[one.name]) for one in self.arguments]}
        lists |= {title: [rows.pop(one) for one in own] for title, own in self.sections.items()}
        lists["Other options" if self.sections else "Options"] = [*rows.values()]
        for title, records in lists.items():
            if records:
                with formatter.section(title):
                    formatter.write_dl(records)


def inputs_of(verb: Callable[..., Any], given: Mapping[str, Any]) -> list[Path]:
    """Files and folders that a verb reads."""
    files = {name for name, one in kinds.keywords(verb).items() if getattr(one.kind, "files", 0)}
    inputs = [path for value in given.values() for path in _paths(value)]
    return inputs + [Path(given[name]) for name in files if isinstance(given.get(name), str)]


def _paths(value: Any) -> list[Path]:
    """Paths among the arguments of a command."""
    if isinstance(value, tuple):
        return [path for one in value for path in _paths(one)]
    return [value] if isinstance(value, Path) else []


def _metavar(parameter: inspect.Parameter) -> str:
    many = "Sequence" in parameter.annotation
    return (parameter.name.removesuffix("s") if many else parameter.name).upper()
