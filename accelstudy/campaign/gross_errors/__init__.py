"""Gross errors of a campaign: what they do, and how they are recognised and undone."""

from accelstudy.campaign.gross_errors.errors import (
    GrossError,
    get_gross_error,
    gross_error_names,
    register,
)

__all__ = ["GrossError", "get_gross_error", "gross_error_names", "register"]
