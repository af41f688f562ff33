"""Gross errors of a campaign, one small file each: what they do, and how to undo it.

To add one, write a module next to this file with a class under `register`.
"""

from accelstudy.basics.registry import import_modules
from accelstudy.campaign.gross_errors.base import (
    GrossError,
    Mending,
    get_gross_error,
    gross_error_names,
    register,
)

__all__ = ["GrossError", "Mending", "get_gross_error", "gross_error_names", "register"]

# A module registers its gross errors when it is imported.
import_modules(__name__, __path__)
