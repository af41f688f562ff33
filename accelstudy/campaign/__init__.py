"""Measured calibration sessions (campaigns): their format, and how raw logs become one."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from accelstudy.campaign.files.format import Campaign, read_campaign, write_campaign

__all__ = ["Campaign", "read_campaign", "write_campaign"]


def __getattr__(name: str) -> Any:
    # The commands stand in this package; to list them must not import what they work with.
    if name in __all__:
        return getattr(import_module("accelstudy.campaign.files.format"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
