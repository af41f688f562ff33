"""SymPy, loaded when something of it is first used.

It takes as long to import as all else that a small job needs, and most jobs only describe models.
"""

from __future__ import annotations

import importlib.util
import sys
from typing import TYPE_CHECKING

__all__ = ["sp"]

if TYPE_CHECKING:
    import sympy as sp
elif "sympy" in sys.modules:
    sp = sys.modules["sympy"]
else:
    _spec = importlib.util.find_spec("sympy")
    _spec.loader = importlib.util.LazyLoader(_spec.loader)
    sp = sys.modules["sympy"] = importlib.util.module_from_spec(_spec)
    _spec.loader.exec_module(sp)
