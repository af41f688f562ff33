"""Run the examples as their reader would, in a folder of their own.

python tests/helpers/example_helpers.py        # draws anew the figures that docs/tutorials shows
"""

import shutil
import tempfile
from pathlib import Path

from places import ROOT
from transcript import Shell, commands_of_script

EXAMPLES = ROOT / "examples"
SHOWN = ROOT / "docs" / "tutorials" / "shown"
"""Figures of the examples, as pages show them."""
FIGURES = {
    "paper": ["paper.png"],
    "log": ["box.png", "box/segmentation.png", "calibrated/figures/residuals.png"],
    "hidden": ["diagnosed/figures/evidence.png"],
    "lot": ["lot/figures/sensors.png"],
    "pole": ["pole.png"],
}
"""Figures of the examples that pages show."""


def run_example(example, folder):
    """Run an example in an empty folder."""
    shutil.copytree(EXAMPLES / example, folder, dirs_exist_ok=True)
    shell = Shell(folder)
    for command in commands_of_script((folder / "commands.sh").read_text(encoding="utf-8")):
        status, printed, warned = shell.run(command)
        assert status == 0, f"{command}: {printed}{warned}"


if __name__ == "__main__":
    for name, figures in FIGURES.items():
        with tempfile.TemporaryDirectory() as place:
            run_example(name, Path(place, name))
            for figure in figures:
                shutil.copy(Path(place, name, figure), SHOWN / name)
