"""What every job of the workflow does: log to its file, and end with one line on bad input."""

from __future__ import annotations

import errno
import gc
import logging
import sys
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from accelstudy import __version__
from accelstudy.basics.errors import InputError
from accelstudy.basics.plugins import code_digest, digests, load_plugins
from accelstudy.basics.units import angles_in
from accelstudy.files.outputs import cannot_write
from accelstudy.files.reading import config_hash

# A job ends soon and makes few cycles. Python would look for them again and again while modules are
# imported, which make a quarter of a million objects, and while a figure is drawn.
gc.set_threshold(500_000)

_NOT_OURS = {
    **dict.fromkeys((errno.ENOSPC, errno.EDQUOT, errno.EFBIG), "free some space"),
    **dict.fromkeys((errno.EACCES, errno.EPERM, errno.EROFS), "make it writable"),
    errno.EIO: "look after the disk",
}
"""Errors of the operating system, and what a person can do about them."""


def code_version(*folders: str | Path, without: Collection[str] = ()) -> str:
    """Return the version of this package, and digests of its code and of the plug-ins there are.

    Snakemake notices that a script has changed, but not that a package has. With this as a
    parameter of a rule it does.

    Parameters
    ----------
    folders : whose code counts, too
    without : names of folders of this package whose code does not
    """
    own = Path(__file__).parents[1]
    code = code_digest(own, *map(Path, folders), without=[own / folder for folder in without])
    return " ".join([__version__, code, *digests().values()])


def killed_notice(logs: Iterable[str]) -> str | None:
    """Return what to do if Snakemake's logs say that a job was killed; else None."""
    text = "".join(Path(log).read_text(encoding="utf-8", errors="replace") for log in logs)
    if "<Signals.SIGKILL: 9>" not in text and "exit status 137" not in text:
        return None
    return (
        "A job was killed: by somebody, or by the system as the memory did not suffice. The same "
        "command goes on where this run stopped; --cores 1 (make CORES=1) needs the least memory."
    )


@contextmanager
def job(snakemake: Any) -> Iterator[dict[str, Any]]:
    """Run the body of a rule's script; yields the provenance of its outputs."""
    with script_log(snakemake):
        seed = snakemake.params.get("seed", snakemake.config.get("seed"))
        yield {"config_hash": config_hash(snakemake.config), "seed": seed}


@contextmanager
def script_log(snakemake: Any) -> Iterator[None]:
    """Run the body of a script of any workflow, with angles in the unit of its rule, if any."""
    gc.freeze()  # Python would look among all modules whenever it looks for cycles
    # On a full disk the log ends early, but the error of the job is still reported.
    logging.raiseExceptions = False
    try:
        logging.basicConfig(
            filename=snakemake.log[0],
            filemode="w",
            level=logging.INFO,
            format="%(asctime)s %(levelname)s %(message)s",
        )
        load_plugins(snakemake.config)
        with angles_in(snakemake.params.get("angle_unit")):
            yield
        gc.freeze()  # and among those imported since, as it ends, for a fifth of a second
    except InputError as error:
        _end(str(error))
    except MemoryError:
        _end(
            f"{snakemake.rule}: not enough memory; run fewer jobs at once (--cores 1, or "
            "make CORES=1), or on a machine that has more"
        )
    except OSError as error:
        if error.errno not in _NOT_OURS:
            logging.exception("%s failed", snakemake.rule)
            raise
        message = cannot_write(error, Path(snakemake.output[0]))
        _end(f"{message}; {_NOT_OURS[error.errno]} and run again")
    except Exception:
        logging.exception("%s failed", snakemake.rule)
        raise


def _end(message: str) -> None:
    logging.error("%s", message)
    print(f"error: {message}", file=sys.stderr)
    sys.exit(2)
