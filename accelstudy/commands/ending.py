"""Errors and interruptions of a command: one line on standard error, and an exit status."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from threading import current_thread, main_thread
from types import FrameType
from typing import NoReturn

import click

from accelstudy.basics.errors import InputError


@contextmanager
def bad_input_as_one_line() -> Iterator[None]:
    """End with one line and exit status 2 where the input is bad, or a system call fails."""
    try:
        yield
    except InputError as error:
        _end(str(error))
    except BrokenPipeError:  # whoever read the output needs no more; click ends quietly
        raise
    except OSError as error:
        # Errors of files name the file. What is without a name is a stream that is open always.
        where = "standard output" if error.filename is None else error.filename
        _end(f"{where}: {error.strerror or error}")


@contextmanager
def interruptible() -> Iterator[None]:
    """End with one line where Ctrl-C or SIGTERM comes, whatever a library makes of it.

    What was begun is removed, and the exit status is that of shells, 128 and the number of the
    signal. Some libraries report a signal as an error of their own: pandas as one of the file that
    it reads, numpy as one of its import.
    """
    came = None

    def stop(number: int, frame: FrameType | None) -> NoReturn:
        nonlocal came
        came = number
        raise KeyboardInterrupt

    numbers = (signal.SIGINT, signal.SIGTERM) if current_thread() is main_thread() else ()
    heeded = [number for number in numbers if signal.getsignal(number) is not signal.SIG_IGN]
    handlers = [signal.signal(number, stop) for number in heeded]
    try:
        yield
    except (Exception, KeyboardInterrupt) as error:
        if came is None and not isinstance(error, KeyboardInterrupt):
            raise
        click.echo("interrupted", err=True)
        raise SystemExit(128 + (came or signal.SIGINT)) from None
    finally:
        for number, handler in zip(heeded, handlers, strict=True):
            signal.signal(number, handler)


def _end(message: str) -> NoReturn:
    click.echo(f"error: {message}", err=True)
    raise SystemExit(2) from None
