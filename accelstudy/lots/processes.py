"""The processes in which the campaigns of a lot are weighed; they end with the program."""

from __future__ import annotations

import ctypes
import signal
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from functools import partial
from multiprocessing import active_children, get_context
from typing import Any, TypeAlias

from accelstudy.basics.errors import InputError

Mapped: TypeAlias = Callable[..., Iterator[Any]]
"""Maps a function over sensors, in one process or in several."""

END_WITH_PARENT = 1
"""Option of prctl(2) by which a process gets a signal when its parent ends, PR_SET_PDEATHSIG."""


@contextmanager
def processes(cores: int, n: int) -> Iterator[Mapped]:
    """What maps a function over n campaigns, in as many processes as there are cores.

    Elsewhere than on Linux processes start anew, with all imports; there is one.
    """
    cores = min(cores, n)
    if cores == 1 or sys.platform != "linux":
        yield map
        return
    others = {*active_children()}
    with ProcessPoolExecutor(cores, get_context("fork"), _work) as pool:
        try:
            yield partial(pool.map, chunksize=min(4, -(-n // cores)))
        except BrokenProcessPool:
            raise InputError(
                "a process of the lot was killed, most likely because memory ran out; "
                "use fewer `cores`"
            ) from None
        except BaseException:
            for worker in {*active_children()} - others:
                worker.kill()
            raise


def _work() -> None:
    """Let a worker end with the process that it works for, which alone answers to Ctrl-C.

    Handlers that the program has for SIGTERM are no matter of a worker: it would outlive the signal
    by which the pool ends it.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    ctypes.CDLL(None).prctl(END_WITH_PARENT, signal.SIGKILL)
