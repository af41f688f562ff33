"""Where numbers come from: the code that made them, and a place where they can be written."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import accelstudy
from accelstudy.errors import InputError

# Files that a stage does not use, so that an edit of them does not run it again. What is not named
# counts: a new file runs everything again rather than nothing.
_MEASURED = ("campaign/", "diagnosis/", "gross_errors/", "hidden/", "adjustment/quality/")
_PLANNING = ("data_sheets/", "field/", "plan/", "sequential/", "pole/")
_COMMANDS = ("cli.py", "catalogue.py", "study/earlier.py", *_PLANNING)
_FRONT = (
    *_COMMANDS,
    "figures/",
    "study/claims",
    "study/report.py",
    "study/job.py",
    "pages/",
    "plausibility.py",
    "wording.py",
    *_MEASURED,
)
_TABLES = (
    *(f"study/{name}.py" for name in ("distributions", "kept", "statistics", "summary")),
    "closed_forms.py",
    "shares.py",
)
_CONFIG = ("study/config/",)
_SENSITIVITY = ("sensitivity.py", "leveling_shares.py", "shapley.py")
_STUDY = (
    "study/claims",
    "kernel/",
    "adjustment/block.py",
    *(f"study/{name}.py" for name in ("analysis", "batches", "cells", "compiling")),
    *(f"study/{name}.py" for name in ("distributions", "followed", "kept", "moments")),
    *(f"study/{name}.py" for name in ("simulate", "sketch", "statistics", "summary")),
)
_SCORED = tuple(
    f"hidden/{name}.py"
    for name in ("figures", "judging", "limits", "page", "rates", "report", "score", "targets")
)
_DECIDED = tuple(f"diagnosis/{name}" for name in ("evidence/", "decision/", "pipeline.py"))
_NOT_HIDDEN = (*_COMMANDS, "campaign/overview", "diagnosis/report/", "pages/", *_STUDY)
_UNUSED = {
    "simulate": (*_FRONT, *_TABLES, *_SENSITIVITY, *_CONFIG),
    "summarise": (*_FRONT, *_SENSITIVITY, *_CONFIG),
    "sensitivity": (*_FRONT, *_TABLES, "leveling_error.py"),
    "claims": (*_COMMANDS, "figures/", "plausibility.py", *_MEASURED),
    "figures": (*_COMMANDS, "study/claims", "pages/", "plausibility.py", "wording.py", *_MEASURED),
    "campaign": (*_COMMANDS, "campaign/overview", "diagnosis/", "hidden/", *_STUDY),
    "diagnosis": (*_COMMANDS, "campaign/overview", "hidden/", *_STUDY),
    "overview": (*_COMMANDS, "figures/", "adjustment/", "diagnosis/", "hidden/", *_STUDY),
    "plan": (
        *_NOT_HIDDEN,
        "diagnosis/",
        "figures/",
        "hidden/baselines.py",
        "hidden/run.py",
        *_SCORED,
    ),
    "hidden": (*_NOT_HIDDEN, "figures/", "hidden/baselines.py", *_SCORED),
    "baselines": (*_NOT_HIDDEN, "figures/", *_DECIDED, *_SCORED),
    "planning": ("cli.py", "catalogue.py", "study/earlier.py", "hidden/"),
    "score": (*_NOT_HIDDEN, "hidden/baselines.py", *_DECIDED),
}


def config_hash(config: Mapping[str, Any]) -> str:
    """Hash of all that the numbers of a study depend on.

    Parameters
    ----------
    config : mapping, the whole configuration with its defaults, as plain data
    """
    unused = {"angle_unit"} if config.get("schemes") else {"angle_unit", "schemes"}
    content = {key: value for key, value in config.items() if key not in unused}
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:16]


def code_hash(stage: str) -> str:
    """Hash of the package's files on which a stage of the workflow depends.

    Snakemake does not see that a package has changed; as a parameter of a rule this shows it.
    """
    root = Path(accelstudy.__file__).parent
    digest = hashlib.sha256()
    for path in sorted([*root.rglob("*.py"), *root.rglob("*.j2")]):
        name = path.relative_to(root).as_posix()
        if not name.startswith(_UNUSED[stage]):
            digest.update(name.encode())
            digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def check_writable(folder: str | Path) -> None:
    """Check that a folder and those in it can be written to, or that it can be made.

    Raises
    ------
    InputError
        If it, a folder in it, or the nearest folder above it that exists, is not writable, or is no
        folder.
    """
    folder = Path(folder)
    nearest = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    if not nearest.is_dir():
        raise InputError(f"{folder}: cannot hold results: {nearest} is not a folder")
    inside = (Path(path) for path, _, _ in os.walk(folder))  # of the folder itself, if it is there
    for path in (nearest, *inside):
        if not os.access(path, os.W_OK | os.X_OK):
            raise InputError(f"{folder}: cannot hold results: {path} is not writable")
