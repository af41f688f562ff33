"""What the results of the functions for programs have in common."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from accelstudy.basics.arguments import path_of
from accelstudy.basics.progress import say, show
from accelstudy.drawing.style import FULL, MM, in_style
from accelstudy.files.documents import Document
from accelstudy.files.outputs import OutputKind, new_file
from accelstudy.pages.notebook import notebook_html

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes


class Result(ABC):
    """What a function found: its state in a word, a verdict in sentences, a table and a figure.

    Results are equal to themselves alone. `save` writes what the command of the same name does.

    Attributes
    ----------
    name : str, what it is the result of
    """

    name: str
    kind: ClassVar[OutputKind | None] = None
    """Of the folder that is written; a result that is a file has none."""
    new_file: ClassVar[Callable[..., AbstractContextManager[Path]]] = staticmethod(new_file)
    """Opens that file."""
    exit_status = 0
    """Of the command; where it is not 0, there is nothing to write."""
    document: ClassVar[type[Document]]
    """Of the JSON file that is written, whose keys are names of attributes."""
    size = FULL, 62.0
    """Width (inches) and height (mm) of the main figure."""

    @property
    def content(self) -> Mapping[str, Any]:
        """Content of the JSON file that `save` writes, or what it would say if there is none."""
        return self.document.of(self)

    @property
    def state(self) -> str:
        """State in a word, as the badge of the page has it."""
        return str(self.content["state"])

    @property
    def verdict(self) -> str:
        """Verdict in sentences."""
        return str(self.content["verdict"])

    @abstractmethod
    def to_frame(self) -> pd.DataFrame:
        """Return the main table, in SI but for columns that name another unit."""

    @abstractmethod
    def draw(self, ax: Axes) -> None:
        """Draw the main figure into axes."""

    def write(self, folder: Path, place: Path) -> None:
        """Write all files into a folder that is there; the page names `place` as theirs."""
        self.document.write(folder, self.content)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the main figure into given axes, or into new ones, and return them."""
        figure = None
        if ax is None:
            from matplotlib import pyplot

            # A notebook gets ready to show figures at its first one; the style would undo that.
            size = self.size[0], self.size[1] * MM
            figure = pyplot.figure(figsize=size, layout="constrained")
        with in_style():
            ax = figure.add_subplot() if ax is None and figure else ax
            assert ax is not None
            self.draw(ax)
            for axis in (ax.xaxis, ax.yaxis):
                axis.get_major_ticks()  # made in this style, and not where the figure is shown
        return ax

    def tell(self, place: Path) -> None:
        """Print what the command of the same name does, after it wrote the files to a place."""
        show(f"{self.state.upper()}: {self.verdict}")
        say(f"report: {place / 'report.html'}")

    def save(self, folder: str | PathLike[str], *, force: bool = False) -> None:
        """Write the files of the command of the same name.

        Parameters
        ----------
        folder : path, made if it is not there; that of the file, if the result is one
        force : bool, whether to overwrite files of the same names

        Raises
        ------
        InputError
            If the folder has such files, or cannot be written; nothing is written then.
        """
        place = path_of("folder", folder)
        with (self.kind.place if self.kind else self.new_file)(place, (), force) as part:
            self.write(part, place)

    def summary(self) -> str:
        """Return a report as text: state, verdict and the main table."""
        head = f"{type(self).__name__} of {self.name}: {self.state}"
        return f"{head}\n{self.verdict}\n\n{self._table()}".rstrip()

    def _table(self) -> str:
        """Return the main table as text."""
        table = self.to_frame()
        return "" if table.empty else table.to_string(float_format="{:.5g}".format, na_rep="–")

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.name!r}, {self.state})"

    def _repr_html_(self) -> str:
        return notebook_html(f"{type(self).__name__}, {self.state}", self.verdict, self.to_frame())
