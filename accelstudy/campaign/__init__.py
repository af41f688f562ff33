"""Measured calibration sessions (campaigns): their format, and how raw logs become one."""

from accelstudy.campaign.format import Campaign, read_campaign, write_campaign

__all__ = ["Campaign", "read_campaign", "write_campaign"]
