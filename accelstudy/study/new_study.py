"""The folder of a new study: a Snakefile, a configuration, a profile and a README."""

from __future__ import annotations

import re
from pathlib import Path

from accelstudy.files.outputs import STUDY, result_folder
from accelstudy.files.shipped import shipped

TEMPLATE = Path(__file__).with_name("template")
PROFILE = "profiles/default/config.yaml"


def new_study(folder: Path, force: bool = False) -> str:
    """Write the folder of a new study.

    Parameters
    ----------
    folder : Path, made if it is not there
    force : bool, whether to replace files of the same names

    Returns
    -------
    str, the name of the study, which is that of the folder as far as a configuration allows it

    Raises
    ------
    InputError
        If the folder is not empty, or cannot be written.
    """
    name = re.sub(r"[^A-Za-z0-9]+", "-", folder.resolve().name).strip("-") or "study"
    with result_folder(folder, STUDY, force=force) as new:
        for source in sorted(path for path in TEMPLATE.rglob("*") if path.is_file()):
            _write(source, new / source.relative_to(TEMPLATE), name)
        _write(shipped(PROFILE), new / PROFILE, name)
    return name


def _write(source: Path, target: Path, name: str) -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    text = source.read_text(encoding="utf-8")
    target.write_text(text.replace("STUDY", name), encoding="utf-8")
