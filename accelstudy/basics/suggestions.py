"""The commands that pages and messages suggest, ready to be pasted into a shell."""

from __future__ import annotations

import os
import shlex
from functools import partial
from pathlib import Path

from accelstudy.basics.names import MAX_NAME_BYTES
from accelstudy.basics.plugins import loaded_files

HERE = "calibration.json"
"""Name of a calibration file, as pages mention it."""


def apply(calibration: str | Path) -> str:
    """Level a log."""
    out = new_name(Path(calibration).parent, "leveled.csv")
    return _line("apply", Path(calibration), "LOG", "--out", out)


def export(form: str, calibration: str | Path) -> str:
    """Turn a calibration into what a device can use."""
    return _line("export", Path(calibration), "--form", form)


def new_name(folder: str | Path, what: str) -> Path:
    """Name in the current folder for what comes of a folder.

    It is made of the whole path as it was typed: imu/left and imu/right have results of their own,
    and so have first/left and second/left.
    """
    path = Path(folder)
    parts = [part for part in path.relative_to(path.anchor).parts if part != os.pardir]
    text = "".join(sign if sign.isprintable() else "-" for sign in "-".join([*parts, what]))
    return Path(text.encode(errors="replace")[-2 * MAX_NAME_BYTES :].decode(errors="ignore"))


def _of_campaign(
    command: str,
    what: str,
    campaign: str | Path,
    model: str | Path,
    approach: str,
    prior: str | Path | None = None,
) -> str:
    path, chosen = Path(campaign), ["--model", model, "--approach", approach]
    if prior is not None:
        chosen += ["--prior", prior]
    out = new_name(path, what)
    if Path.cwd().is_relative_to(path.resolve()):  # nothing is written into a campaign
        out = path / os.pardir / new_name(path.resolve().name, what)
    return _line(command, path, *chosen, "--out", out)


calibrate = partial(_of_campaign, "calibrate", "calibrated")
diagnose = partial(_of_campaign, "diagnose", "diagnosis")


def _line(*parts: str | Path) -> str:
    """A command; a path that begins with a dash is not to be taken for an option."""
    words = [f"./{p}" if isinstance(p, Path) and str(p).startswith("-") else str(p) for p in parts]
    options = [word for path in loaded_files() for word in ("--plugin", path)]
    return shlex.join(["accelstudy", *words, *options])
