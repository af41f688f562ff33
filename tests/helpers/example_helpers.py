"""Run the examples as their reader would, in a folder of their own.

python tests/helpers/example_helpers.py        # writes anew what docs/tutorials shows of them
"""

import re
import shutil
import tempfile
from pathlib import Path

from places import ROOT
from transcript import Shell, commands_of_script

EXAMPLES = ROOT / "examples"
SHOWN = ROOT / "docs" / "tutorials" / "shown"
"""What pages show of the examples: output as <example>/<section>.txt, figures as PNG."""
FIGURES = {
    "paper": ["paper.png"],
    "log": ["box.png", "box/segmentation.png", "calibrated/figures/residuals.png"],
    "hidden": ["diagnosed/figures/evidence.png"],
    "lot": ["lot/figures/sensors.png"],
    "pole": ["pole.png"],
}
"""Figures of the examples that pages show."""


def sections(example):
    """Commands of each section of an example's commands.sh, {name: [command]}."""
    text = (EXAMPLES / example / "commands.sh").read_text(encoding="utf-8")
    found = re.findall(r"\[start:(\w+)\]\n(.*?)# --8<-- \[end:\1\]", text, re.DOTALL)
    return {name: commands_of_script(block) for name, block in found}


def run_example(example, folder):
    """Run an example in an empty folder; what a terminal shows by section."""
    shutil.copytree(EXAMPLES / example, folder, dirs_exist_ok=True)
    shell = Shell(folder)
    return {
        name: "".join(map(shell.output, commands)) for name, commands in sections(example).items()
    }


def written_anew():
    """Write what pages show of the examples."""
    shutil.rmtree(SHOWN, ignore_errors=True)
    for example in sorted(path.parent.name for path in EXAMPLES.glob("*/commands.sh")):
        shown = SHOWN / example
        shown.mkdir(parents=True)
        with tempfile.TemporaryDirectory() as folder:
            for name, output in run_example(example, Path(folder)).items():
                if output:
                    (shown / f"{name}.txt").write_text(output, encoding="utf-8")
            for figure in FIGURES.get(example, ()):
                shutil.copy(Path(folder, figure), shown)


if __name__ == "__main__":
    written_anew()
