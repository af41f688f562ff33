"""Stand-ins for the figures of pages, as it takes longer to draw them than to compute all else."""

from contextlib import contextmanager

import pytest

from accelstudy.drawing import saving

ELEMENT, SAVE = saving._element, saving.save
STAND_IN = "<svg></svg>"


def element(_, folder, name, kinds):
    """Write files in place of a figure, and return the element that stands for it on the page."""
    for kind in kinds:
        write(folder / f"{name}.{kind}")
    return STAND_IN


def write(path):
    """Write a file in place of a figure."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(STAND_IN.encode() if path.suffix == ".svg" else bytes(2000))


@contextmanager
def composed(*rendered):
    """Let all figures of pages be composed; those of some names are rendered, too."""

    def save(figure, path, title, dpi):
        SAVE(figure, path, title, dpi) if title in rendered else write(path)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(saving, "_element", ELEMENT)
        patch.setattr(saving, "save", save)
        yield


@contextmanager
def drawn():
    """Let all figures of pages be drawn."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(saving, "_element", ELEMENT)
        yield
