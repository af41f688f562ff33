"""What every job of the workflow does: log to its file, and end with one line on bad input."""

from __future__ import annotations

import logging
import shlex
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from accelstudy.errors import InputError
from accelstudy.study.config import StudyConfig, parse_study


def quote_python() -> None:
    """Let jobs start though the path of Python has a space.

    Snakemake writes that path into commands of the shell as it is.
    """
    sys.executable = shlex.quote(sys.executable)


@contextmanager
def job(snakemake: Any) -> Iterator[tuple[StudyConfig, Mapping[str, Any]]]:
    """Run the body of a rule's script.

    Gives the study and the provenance of what the job writes (`config_hash` and `seed`).
    """
    with logged(snakemake):
        study = parse_study(snakemake.config)
        yield study, {"config_hash": study.fingerprint, "seed": study.seed}


@contextmanager
def logged(snakemake: Any) -> Iterator[None]:
    """Run the body of a script of any workflow."""
    logging.basicConfig(
        filename=snakemake.log[0],
        filemode="w",
        level=logging.INFO,
        format="%(asctime)s %(levelname)s %(message)s",
    )
    try:
        yield
    except InputError as error:
        logging.error("%s", error)
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)
    except Exception:
        logging.exception("%s failed", snakemake.rule)
        raise
