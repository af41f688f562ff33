"""Position schemes: in which attitudes a sensor is held while it is calibrated.

To add one, write a module next to this file with a function under `register`.
"""

from importlib import import_module
from pkgutil import iter_modules

from accelstudy.schemes.optimal import optimal_directions
from accelstudy.schemes.registry import (
    Scheme,
    Status,
    UnknownSchemeError,
    get_scheme,
    register,
    scheme_families,
    scheme_names,
)

__all__ = [
    "Scheme",
    "Status",
    "UnknownSchemeError",
    "get_scheme",
    "optimal_directions",
    "register",
    "scheme_families",
    "scheme_names",
]

# A module registers its schemes when it is imported.
for _module in iter_modules(__path__):
    import_module(f"{__name__}.{_module.name}")
