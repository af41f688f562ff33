"""The command `accelstudy`, also as ``python -m accelstudy``."""

import gc
import os
import signal
import sys
from io import TextIOWrapper


def run() -> None:
    """Run the command line."""
    # A stream that is closed would be one of the files that are opened, and the error of a library.
    for name in ("stdin", "stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "r" if name == "stdin" else "w"))  # noqa: SIM115
    if isinstance(sys.stdout, TextIOWrapper):  # whose encoding may lack signs, such as the minus
        sys.stdout.reconfigure(errors="backslashreplace")
    # Until a command begins nothing is written, so Ctrl-C may end it at once.
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _end)
    # Imports and figures make a million objects that stay. To look for garbage among them again
    # and again takes a tenth of the time of a command.
    gc.set_threshold(300_000, 50, 50)
    os.environ["MPLBACKEND"] = "agg"  # figures go to files; a name of no backend would be an error
    # The matrices are small: threads of BLAS would spend most of their time on waiting.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from accelstudy.commands.main import main

    try:
        main(prog_name="accelstudy")
    finally:
        gc.freeze()  # Python would look among all of them once more before it ends


def _end(number: int, frame: object) -> None:
    """End as `accelstudy.commands.ending` does, which is not imported yet."""
    os.write(2, b"interrupted\n")
    os._exit(130)


if __name__ == "__main__":
    run()
