"""What a command reports while it works: lines and, for long work, a line on a terminal that goes.

A function reports by `track` and `stage`, wherever it stands. They show nothing unless a command
asks for it by `feedback`, so that the package is silent when it is used from Python. `say` is
for commands themselves: it prints unless `feedback` is quiet.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable, Iterator, Sized
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TypeVar

import click

from accelstudy.basics.errors import OPTIONS, for_user, printable

Item = TypeVar("Item")
_quiet: ContextVar[bool] = ContextVar("quiet", default=False)
_wanted: ContextVar[bool] = ContextVar("wanted", default=False)
CLEAR = "\r\x1b[2K"
"""What clears the line of a terminal."""


@contextmanager
def feedback(quiet: bool = False) -> Iterator[None]:
    """Show within a ``with`` block what `track` and `stage` report; or be quiet, `say` included."""
    tokens = _quiet.set(quiet), _wanted.set(not quiet and _can_clear())
    try:
        yield
    finally:
        _quiet.reset(tokens[0])
        _wanted.reset(tokens[1])


def _can_clear() -> bool:
    """Whether standard error is a terminal that can take back a line."""
    return sys.stderr.isatty() and os.environ.get("TERM") != "dumb"


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
    """Say on standard error that long work begins, where it is no terminal and shows no stages."""
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
    """Show `what` is being done within a ``with`` block, on a line that goes at its end.

    Stages may lie within each other; the line is that of the inner one, as long as it lasts.

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
    shares: list[int] = []
    done = 0.0

    def advance(part: float) -> None:
        nonlocal done
        done += part
        share = int(100 * done / total) if total else 0
        if share not in shares:  # a terminal is slow
            shares.append(share)
            click.echo(f"{CLEAR}{what}{f' {share} %' if total else ''}", nl=False, err=True)

    advance(0)
    try:
        yield advance
    finally:
        click.echo(CLEAR, nl=False, err=True)


def track(items: Iterable[Item], what: str, total: float | None = None) -> Iterator[Item]:
    """Yield `items` and show how many of them (of `total`, by default their number) are done."""
    if total is None and isinstance(items, Sized):
        total = len(items)
    with stage(what, total) as advance:
        for item in items:
            yield item
            advance(1)
