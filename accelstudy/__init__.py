"""Monte Carlo study of the calibration of tri-axial accelerometers for leveling.

What a program needs is listed in `__init__.pyi`, which type checkers and editors read, too. A name
is imported when it is first asked for.
"""

import re
from importlib import import_module
from pathlib import Path

_LINE = re.compile(r"^from (\S+) import (\w+) as", re.MULTILINE)
_NAMES = Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8")
_MODULES = {name: module for module, name in _LINE.findall(_NAMES)}
__all__ = sorted(_MODULES)


def __getattr__(name: str) -> object:
    """Import a name when it is asked for, since that takes long."""
    if name == "__version__":
        from importlib.metadata import version

        return version(__name__)
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_MODULES[name]), name)


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
