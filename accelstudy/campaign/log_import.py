"""Campaigns that are made of logs and of public data, for the public functions."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass
from glob import escape
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from accelstudy.basics.arguments import as_sequence, path_of, paths_of
from accelstudy.basics.names import natural
from accelstudy.basics.progress import say, show, warn
from accelstudy.basics.wording import plural
from accelstudy.campaign.format import write_campaign
from accelstudy.campaign.importing.bags import BAG_OF_FOLDER
from accelstudy.campaign.importing.log import Log
from accelstudy.campaign.importing.logs import import_log
from accelstudy.campaign.importing.public import import_settings, public_file
from accelstudy.campaign.importing.settings import settings_of
from accelstudy.campaign.reference_log import reference_of
from accelstudy.campaign.session import Campaign

if TYPE_CHECKING:
    from accelstudy.campaign.importing.holds import Holds


@dataclass(frozen=True)
class LogImport:
    """A campaign, and the holds that it was made of, which a figure shows.

    Attributes
    ----------
    campaign : Campaign
    holds : Holds of the log; None of a table of means
    figure : bool, whether it is drawn
    """

    campaign: Campaign
    holds: Holds | None
    figure: bool = True

    @classmethod
    def of(cls, log: Any, figure: bool = True, **given: Any) -> LogImport:
        """Import a log by the keywords of `find_holds`, checked."""
        logs = [log] if isinstance(log, Log | pd.DataFrame) else files_of(as_sequence(log))
        return cls(*import_log(logs, settings_of(given), reference_of(given)), figure)

    @classmethod
    def of_public(cls, name: str, folder: str | PathLike[str]) -> LogImport:
        """Import public data."""
        settings = import_settings(name)
        return cls(*import_log(public_file(name, Path(folder)), settings))

    def write(self, folder: Path, place: Path) -> None:
        """Write the folder of the campaign and, of a log, segmentation.png."""
        write_campaign(self.campaign, folder)
        if self.figure and (holds := self.holds) is not None:
            # Matplotlib takes longer to import than a log of usual length to read.
            from accelstudy.campaign.importing import segmentation_figure
            from accelstudy.drawing.saving import save_all

            draw = {"segmentation": lambda: segmentation_figure.draw_segmentation(holds)}
            save_all(draw, folder, ["png"])

    def tell(self, place: Path) -> None:
        """Print what was imported, with its warnings, and where to."""
        for line in self.campaign.notes:
            say(line)
        for warning in self.campaign.warnings:
            warn(warning)
        if self.figure and self.holds is not None:
            say(f"figure: {place / 'segmentation.png'}")
        positions = plural(self.campaign.n_positions, "position")
        show(f"campaign: {place} ({positions})")


def files_of(given: Iterable[str | PathLike[str]]) -> list[Path]:
    """Files named by paths of files and folders, and by patterns.

    Those of a folder or a pattern come in the order of their names, and pos2 before pos10. So do
    files in the order of the alphabet, which is how a shell lists them.

    Raises
    ------
    InputError
        If there is none, or one is given twice.
    """
    patterns: list[Path] = []
    for path in (path_of("log", one, "a path, or one DataFrame outside a list") for one in given):
        is_folder = path.is_dir() and not (path / BAG_OF_FOLDER).is_file()
        patterns.append(Path(escape(str(path)), "*") if is_folder else path)
    files: list[Path] = paths_of(patterns, "file", os.path.isfile)
    if files == sorted(files):
        files.sort(key=natural)
    return files
