"""The command `accelstudy`, also as ``python -m accelstudy``."""

import gc
import os


def run() -> None:
    """Run the command line."""
    # Imports and figures make a million objects that stay. To look for garbage among them again
    # and again takes a tenth of the time of a command.
    gc.set_threshold(100_000, 50, 50)
    # The matrices are small: threads of BLAS would spend most of their time on waiting.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from accelstudy.commands.main import main

    main(prog_name="accelstudy")


if __name__ == "__main__":
    run()
