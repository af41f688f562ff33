"""Position schemes: in which attitudes a sensor is held while it is calibrated.

To add one, write a module next to this file with a function under `register`.
"""

from accelstudy.basics.registry import import_modules
from accelstudy.positions.scheme import Scheme, Status
from accelstudy.schemes.files import is_scheme_file
from accelstudy.schemes.registry import (
    get_scheme,
    register,
    scheme_families,
    scheme_names,
)

__all__ = [
    "Scheme",
    "Status",
    "get_scheme",
    "is_scheme_file",
    "register",
    "scheme_families",
    "scheme_names",
]

# A module registers its schemes when it is imported.
import_modules(__name__, __path__)
