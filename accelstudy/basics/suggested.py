"""The commands that pages and messages suggest, ready to be pasted into a shell."""

from __future__ import annotations

import shlex
from pathlib import Path

from accelstudy.basics.names import path_name

HERE = "calibration.json"
"""Name of a calibration file, as pages mention it."""


def apply(calibration: str | Path = HERE) -> str:
    """Level a log."""
    return _line("apply", calibration, "LOG", "--out", "leveled.csv")


def export(form: str, calibration: str | Path = HERE) -> str:
    """Turn a calibration into what a device can use."""
    return _line("export", calibration, "--form", form)


def calibrate(campaign: str | Path, model: str | Path, approach: str, out: str) -> str:
    """Calibrate a campaign."""
    return _line("calibrate", campaign, "--model", model, "--approach", approach, "--out", out)


def diagnose(campaign: str | Path, model: str, approach: str, name: str) -> str:
    """Find what a model lacks to explain a campaign of that name."""
    chosen = ["--model", model, "--approach", approach]
    return _line("diagnose", campaign, *chosen, "--out", folder(name, "diagnosis"))


def folder(name: str, kind: str) -> str:
    """Name of a folder for the results of a campaign, whose name may be any text."""
    return f"{path_name(name, 'campaign')}-{kind}"


def _line(*parts: str | Path) -> str:
    return shlex.join(["accelstudy", *map(str, parts)])
