"""Files of the package that are not Python code: the workflow, configurations, profiles."""

from __future__ import annotations

from pathlib import Path

import accelstudy


def shipped(path: str) -> Path:
    """Path of a file or folder that comes with the package.

    In a clone it lies beside the package; after installation it lies within it.

    Parameters
    ----------
    path : str, as in a clone, such as ``workflow/Snakefile``
    """
    package = Path(accelstudy.__file__).parent
    installed = package / "shipped"
    return (installed if installed.is_dir() else package.parent) / path
