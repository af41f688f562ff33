"""Stand-ins for the figures of pages, as it takes longer to draw them than to compute all else."""

from contextlib import contextmanager

import pytest

from accelstudy.drawing import saving

ELEMENT, SAVE = saving._element, saving.save
STAND_IN = "<svg></svg>"


def element(_, folder, name, dpi=0):
    """Write files in place of a figure, and return the element that stands for it on the page."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{name}.svg").write_text(STAND_IN, encoding="utf-8")
    (folder / f"{name}.png").write_bytes(bytes(2000))
    return STAND_IN


@contextmanager
def composed(*rendered):
    """Let all figures of pages be composed; those of some names are rendered, too."""

    def save(figure, svg_path, png_path, title, dpi):
        if title in rendered:
            return SAVE(figure, svg_path, png_path, title, dpi)
        return element(figure, svg_path.parent, title)

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
