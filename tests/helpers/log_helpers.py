"""Logs as tests read them."""

from accelstudy.campaign.header import LogLayout
from accelstudy.campaign.importing.recording import Recording, read_log
from accelstudy.files.validation import checked


def open_log(path, **layout):
    """Open a log as keys of its layout say."""
    return Recording([read_log(path, checked(LogLayout, layout, "layout"))])
