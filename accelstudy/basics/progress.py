"""What a command reports while it works: lines and, for long work, bars on a terminal.

A function reports by `track` and `stage`, wherever it stands. They show nothing unless a command
asks for it by `feedback`, so that the package is silent when it is used from Python. `say` is
for commands themselves: it prints unless `feedback` is quiet.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Sized
from contextlib import ExitStack, contextmanager
from contextvars import ContextVar
from functools import partial
from typing import TYPE_CHECKING, TypeVar

import click

from accelstudy.basics.errors import OPTIONS, for_user, printable

if TYPE_CHECKING:
    from rich.progress import Progress

Item = TypeVar("Item")
_quiet: ContextVar[bool] = ContextVar("quiet", default=False)
_wanted: ContextVar[bool] = ContextVar("wanted", default=False)
_bars: ContextVar[Progress | None] = ContextVar("bars", default=None)


@contextmanager
def feedback(quiet: bool = False) -> Iterator[None]:
    """Show within a ``with`` block what `track` and `stage` report; or be quiet, `say` included."""
    tokens = _quiet.set(quiet), _wanted.set(not quiet and sys.stderr.isatty())
    try:
        yield
    finally:
        _quiet.reset(tokens[0])
        _wanted.reset(tokens[1])


def say(text: str) -> None:
    """Print a line about what was done, unless it is called within ``feedback(quiet=True)``."""
    if not _quiet.get():
        show(text)


def show(text: str) -> None:
    """Print a line of the result, whether the command is quiet or not.

    It may quote a file, so characters that control a terminal are spelled out.
    """
    click.echo("\n".join(map(printable, for_user(text).split("\n"))))


def begin(text: str) -> None:
    """Say on standard error that long work begins, where no bar can show it: it is no terminal."""
    if OPTIONS.get() is not None and not _quiet.get() and not sys.stderr.isatty():
        click.echo(text, err=True)


def warn(text: str) -> None:
    """Print a warning on standard error, whether the command is quiet or not."""
    click.echo(f"warning: {printable(for_user(text))}", err=True)


def failure(what: str, error: Exception) -> str:
    """Say what failed and by which error, and warn of it on stderr."""
    reason = " ".join(str(error).split())[:200]
    text = f"{what} ({type(error).__name__}: {reason})."
    warn(text)
    return text


@contextmanager
def stage(what: str, total: float | None = None) -> Iterator[Callable[[float], None]]:
    """Show `what` is being done within a ``with`` block; stages may lie within each other.

    Parameters
    ----------
    what : str
        Such as "null simulation".
    total : float, optional
        The whole amount of work; the stage yields a function to be called with each part done.
    """
    if not _wanted.get():
        yield lambda done: None
        return
    with ExitStack() as stack:
        bars = _bars.get() or stack.enter_context(_progress_bars())
        task = bars.add_task(what, total=total)
        stack.callback(bars.remove_task, task)
        yield partial(bars.advance, task)


def track(items: Iterable[Item], what: str, total: float | None = None) -> Iterator[Item]:
    """Yield `items` and show how many of them (of `total`, by default their number) are done."""
    if total is None and isinstance(items, Sized):
        total = len(items)
    with stage(what, total) as advance:
        for item in items:
            yield item
            advance(1)


@contextmanager
def _progress_bars() -> Iterator[Progress]:
    """Bars on standard error that vanish at the end; none on a terminal that cannot take back."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    console = Console(stderr=True)
    with Progress(
        SpinnerColumn(),
        TextColumn("{task.description}"),
        BarColumn(),
        TimeElapsedColumn(),
        console=console,
        disable=not console.is_interactive,
        transient=True,
        redirect_stdout=False,
        redirect_stderr=False,
    ) as bars:
        token = _bars.set(bars)
        try:
            yield bars
        finally:
            _bars.reset(token)
