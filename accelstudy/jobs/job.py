"""What every job of the workflow does: log to its file, and end with one line on bad input."""

from __future__ import annotations

import errno
import gc
import hashlib
import json
import logging
import os
import shlex
import sys
from collections.abc import Container, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from accelstudy.basics.errors import InputError
from accelstudy.basics.plugins import load_plugins
from accelstudy.basics.units import angles_in
from accelstudy.files.outputs import cannot_write
from accelstudy.files.reading import config_hash
from accelstudy.files.tables import REMEDY, read_origin

COLLECT_AFTER = 50_000
"""New objects after which Python looks for cycles, instead of 700."""

_NOT_OURS = {
    **dict.fromkeys((errno.ENOSPC, errno.EDQUOT, errno.EFBIG), "free some space"),
    **dict.fromkeys((errno.EACCES, errno.EPERM, errno.EROFS), "make it writable"),
    errno.EIO: "look after the disk",
}
"""Errors of the operating system, and what a person can do about them."""


def prepare_jobs() -> None:
    """Let jobs start though the path of Python has a space, or MPLBACKEND names no backend.

    Snakemake writes that path into commands of the shell as it is. Figures go to files.
    """
    sys.executable = shlex.quote(sys.executable)
    os.environ["MPLBACKEND"] = "agg"


def setup_digest(spec: Any) -> str:
    """Digest of everything that determines the numbers of a batch, given as plain data."""
    return hashlib.sha256(json.dumps(spec, sort_keys=True).encode()).hexdigest()[:16]


def killed_notice(logs: Iterable[str]) -> str | None:
    """Return what to do if Snakemake's logs say that a job was killed; else None."""
    text = "".join(Path(log).read_text(encoding="utf-8", errors="replace") for log in logs)
    if "<Signals.SIGKILL: 9>" not in text and "exit status 137" not in text:
        return None
    return (
        "A job was killed: by somebody, or by the system as the memory did not suffice. The same "
        "command goes on where this run stopped; --cores 1 (make CORES=1) needs the least memory."
    )


def lists(named: Any) -> dict[str, list[str]]:
    """Input files by name, as lists; Snakemake makes a list of one file the file itself."""
    return {
        name: [files] if isinstance(files, str) else list(files) for name, files in named.items()
    }


@contextmanager
def job(snakemake: Any) -> Iterator[Mapping[str, Any]]:
    """Run the body of a rule's script.

    Yields the provenance of the outputs: `config_hash` and `seed` of the configuration, which was
    checked when the workflow started, and, where the rule has the parameter `spec`, its digest as
    `setup`.

    Input tables must have the same seed and, where the rule has the parameter `setups`, one of
    these. They differ only if someone replaced a table while the study ran, such as a job that
    outlived the run that started it.
    """
    with logged(snakemake):
        seed = snakemake.config["seed"]
        provenance = {"config_hash": config_hash(snakemake.config), "seed": seed}
        spec = snakemake.params.get("spec")
        if spec is not None:
            provenance["setup"] = setup_digest(spec)
        for path in snakemake.input:
            if Path(path).suffix == ".parquet":
                _check_origin(path, seed, snakemake.params.get("setups"))
        yield provenance


def _check_origin(path: str, seed: int, setups: Container[str] | None) -> None:
    made = read_origin(path)
    other = setups is not None and "setup" in made and made["setup"] not in setups
    if made["seed"] != seed or other:
        raise InputError(f"{path}: is of another configuration; {REMEDY}")


@contextmanager
def logged(snakemake: Any) -> Iterator[None]:
    """Run the body of a script of any workflow, with angles in the unit of its rule, if any."""
    # A job ends soon and makes few cycles. The collector would look at all modules again and again.
    gc.freeze()
    gc.set_threshold(COLLECT_AFTER)
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
