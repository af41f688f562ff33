"""Ways to calibrate, which the benchmarks compare.

To add one, write a module next to this file with a class under `register`.
"""

from accelstudy.basics.registry import import_modules
from ways.base import WAYS

__all__ = ["WAYS"]

# A module registers its ways when it is imported.
import_modules(__name__, __path__)
