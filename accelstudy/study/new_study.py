"""The folder of a new study: a Snakefile, a configuration, profiles and a README."""

from __future__ import annotations

import os
import re
import shutil
from pathlib import Path

import yaml

from accelstudy.basics.names import MAX_NAME_BYTES
from accelstudy.basics.plugins import file_key
from accelstudy.files.outputs import STUDY
from accelstudy.files.shipped import shipped

TEMPLATE = Path(__file__).with_name("template")


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
    own = os.path.basename(os.path.realpath(folder))
    name = re.sub(r"(?a)[\W_]+", "-", own).strip("-")[:MAX_NAME_BYTES] or "study"
    sources = {
        "Snakefile": "study.smk",
        "config/config.yaml": "study.yaml",
        "README.md": "README.md",
    }
    with STUDY.place(folder, force=force) as new:
        (new / "config").mkdir()
        for target, source in sources.items():
            text = (TEMPLATE / source).read_text(encoding="utf-8")
            text = text.replace("study: NAME", yaml.safe_dump({"study": name}).rstrip())
            (new / target).write_text(text.replace("NAME", name), encoding="utf-8")
        if named := file_key():  # the workflow runs in the new folder
            named = {key: [*map(os.path.abspath, files)] for key, files in named.items()}
            with (new / "config" / "config.yaml").open("a", encoding="utf-8") as file:
                file.write(f"\n{yaml.safe_dump(named)}")
        shutil.copytree(shipped("profiles"), new / "profiles")
    return name
