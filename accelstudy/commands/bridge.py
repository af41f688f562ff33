"""Commands made of verbs: an option for each keyword, with the help of the docstring.

What is of the terminal alone is added here: --out and --force, --angle-unit and --quiet, progress,
and what is printed. cyclopts reads signatures and docstrings, too, but takes 0.2 s longer for
`--help`, and shows defaults of quantities in SI and errors in boxes.
"""

from __future__ import annotations

import inspect
import os
import re
from collections.abc import Callable, Iterable, Mapping
from contextlib import AbstractContextManager, nullcontext
from functools import cached_property
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

import click

from accelstudy.basics.arguments import as_sequence
from accelstudy.basics.errors import OPTIONS
from accelstudy.basics.names import matches
from accelstudy.basics.progress import feedback
from accelstudy.basics.units import ANGLE_UNIT_VARIABLE, angles_in
from accelstudy.commands.listings import tell_value
from accelstudy.verbs import kinds
from accelstudy.verbs.kinds import PATH, Names

Place = Callable[..., AbstractContextManager[Path]]
"""Where a result is written: called with the path, and with `inputs` and `force`."""


def _load(ctx: click.Context, param: click.Parameter, paths: tuple[Path, ...]) -> None:
    """Load files of plug-ins, before anything else of the command is looked at."""
    if paths and not ctx.resilient_parsing:
        from accelstudy.basics.plugins import load_files

        load_files(paths)


PLUGIN = click.Option(
    ["--plugin"],
    type=PATH,
    multiple=True,
    expose_value=False,
    callback=_load,
    help="Python file with effects, schemes and the like of your own.",
)
ANGLE_UNIT = click.Option(
    ["--angle-unit"],
    type=Names("angle_unit", "accelstudy.basics.units:ANGLE_UNITS"),
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
    name : str, of the command; that of the verb if omitted
    run : function that does all of it, with the checked parameters of the verb, and all options
    make : function, or its place as "module:name", that works in place of the verb, with its
        checked parameters and further options
    writes : context manager as `accelstudy.files.outputs.new_file`, or its place as "module:name"
    out : str, help of --out
    optional : bool, whether nothing is written without --out
    options : further options, which come after that of --out
    sections : mapping of a title of the help to names of options, in the order of the help
    """

    def __init__(
        self,
        verb: Callable[..., Any],
        name: str = "",
        *,
        run: Callable[..., None] | None = None,
        make: Callable[..., Any] | str = "",
        writes: Place | str | None = None,
        out: str = "Folder to write to.",
        optional: bool = False,
        options: Iterable[click.Option] = (),
        sections: Mapping[str, str] | None = None,
    ) -> None:
        self.verb, self.writes = verb, writes
        self.run, self.make = run or self._save, make or inspect.unwrap(verb)
        self.sections = {title: names.split() for title, names in (sections or {}).items()}
        signature = inspect.signature(verb).parameters.values()
        self.arguments = [p for p in signature if p.kind is p.POSITIONAL_OR_KEYWORD]
        super().__init__(
            name or str(verb.__name__).replace("_", "-"),
            callback=self._act,
            help=self._spelled(kinds.summary(verb)),
            epilog="\n".join(["\b", "Example:", *(f"  {line}" for line in kinds.examples(verb))]),
        )
        del self.params  # the list of all commands does without them
        self._options = optional, out, [*options]

    @cached_property
    def params(self) -> list[click.Parameter]:  # type: ignore[override]
        """Options and arguments."""
        optional, out, options = self._options
        keywords = kinds.keywords(self.verb)
        place = click.Option(["--out"], type=PATH, required=not optional, help=out)
        first, last = ([], []) if self.writes is None else ([place], [FORCE])
        arguments = map(self._argument, self.arguments)
        of_verb = map(self._option, keywords.values())
        return [*arguments, *first, *options, *of_verb, *last, PLUGIN, ANGLE_UNIT, QUIET]

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
        OPTIONS.set({str(p.name): p.opts[0] for p in self.params if isinstance(p, click.Option)})
        try:
            return super().parse_args(ctx, args)
        except click.NoSuchOption as error:
            kinds.refuse_retired(self.verb, [error.option_name[2:].replace("-", "_")])
            raise

    def _act(self, *, quiet: bool = False, angle_unit: str | None = None, **keywords: Any) -> None:
        with feedback(quiet), angles_in(angle_unit):
            self.run(**kinds.check(self.verb, keywords))

    def _save(self, *, out: Path | None = None, **keywords: Any) -> None:
        """Write the result to --out, and print what it says."""
        force = self.writes is not None and keywords.pop("force")
        place: AbstractContextManager[Path | None] = nullcontext()
        if out is not None:
            place = _resolve(self.writes)(out, self._inputs(keywords), force)
        with place as part:
            result = _resolve(self.make)(**keywords)
            if status := getattr(result, "exit_status", 0):
                result.tell(None)
                raise click.exceptions.Exit(status)
            if part is not None:
                result.write(part, out)
        tell = getattr(result, "tell", None)
        tell(out) if tell else tell_value(result)

    def _inputs(self, keywords: Mapping[str, Any]) -> list[Path]:
        """Files and folders that are read, of patterns, too."""
        files = {name for name, one in kinds.keywords(self.verb).items() if one.kind.files}
        files |= {one.name for one in self.arguments}
        values = (one for name in files for one in as_sequence(keywords[name]) if one is not None)
        paths = [Path(value) for value in values if isinstance(value, str | Path)]
        found = (matches(path, os.path.exists) or [] for path in paths)
        return [*paths, *(Path(one) for several in found for one in several)]

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


def _resolve(place: Any) -> Any:
    """What stands at a place, if it is one as "module:name"."""
    return resolve_name(place) if isinstance(place, str) else place


def _metavar(parameter: inspect.Parameter) -> str:
    many = "Sequence" in parameter.annotation
    return (parameter.name.removesuffix("s") if many else parameter.name).upper()
