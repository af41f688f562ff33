"""Run the examples as their reader would, in a folder of their own.

    python tests/helpers/example_helpers.py        # writes anew what docs/tutorials shows of them

Commands of accelstudy and Python scripts run in this process, which starts no other for them; what
else a reader types, the shell runs. A sweep runs without Snakemake, by the same functions.
"""

import contextlib
import io
import os
import re
import runpy
import shlex
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from unittest import mock

from click.testing import CliRunner
from places import ROOT
from plugin_helpers import forgotten
from study_helpers import run_study

from accelstudy.commands.main import main
from accelstudy.files.reading import overlay, read_layer

EXAMPLES = ROOT / "examples"
SHOWN = ROOT / "docs" / "tutorials" / "shown"
"""What pages show of the examples: output as <example>/<section>.txt, figures as PNG."""
FIGURES = {
    "paper": ["paper.png"],
    "log": ["box.png", "box/segmentation.png", "calibrated/figures/residuals.png"],
    "hidden": ["diagnosed/figures/gap.png", "diagnosed/figures/evidence.png"],
    "lot": ["lot/figures/sensors.png"],
    "pole": ["pole.png"],
}
"""Figures of the examples that pages show."""


def sections(example):
    """Commands of each section of an example's commands.sh, {name: [command]}."""
    text = (EXAMPLES / example / "commands.sh").read_text(encoding="utf-8")
    found = re.findall(r"\[start:(\w+)\]\n(.*?)# --8<-- \[end:\1\]", text, re.DOTALL)
    return {
        name: [line for line in block.replace("\\\n", " ").splitlines() if line.strip()]
        for name, block in found
    }


def run_example(example, folder):
    """Run an example in an empty folder.

    Returns
    -------
    {section: output}, warnings included
    """
    shutil.copytree(EXAMPLES / example, folder, dirs_exist_ok=True)
    with contextlib.chdir(folder):
        return {
            name: "".join(output_of(command, str(folder)) for command in commands)
            for name, commands in sections(example).items()
        }


def output_of(command, folder):
    """Run a command that a reader types, and forget what it registered; what it prints."""
    with only_in(folder):
        return _output_of(command)


def _output_of(command):
    program, *arguments = shlex.split(command)
    if program == "cd":
        os.chdir(arguments[0])
        return ""
    if program == "accelstudy":
        arguments, _, file = (" ".join(map(shlex.quote, arguments))).partition(" '>' ")
        result = CliRunner().invoke(main, shlex.split(arguments))
        if result.exit_code:
            raise RuntimeError(f"{command}: {result.output}") from result.exception
        if file:
            Path(file).write_text(result.stdout, encoding="utf-8")
            return result.stderr
        return result.output
    if program == "python":
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed), mock.patch.object(sys, "argv", arguments):
            runpy.run_path(arguments[0], run_name="__main__")
        return printed.getvalue()
    if program == "snakemake":
        content = overlay(read_layer("config/config.yaml"), read_layer(arguments[-1]))
        results = Path("results", content["study"])
        results.mkdir(parents=True)
        run_study(results, **content)
        return ""
    return subprocess.run(command, shell=True, check=True, capture_output=True, text=True).stdout


@contextlib.contextmanager
def only_in(folder):
    """Let a script import its neighbours, and forget with it what they registered."""
    import matplotlib.pyplot as plt

    before = set(sys.modules)
    sys.path.insert(0, folder)
    try:
        with forgotten():
            yield
    finally:
        sys.path.remove(folder)
        for name in set(sys.modules) - before:
            if (getattr(sys.modules[name], "__file__", None) or "").startswith(folder):
                del sys.modules[name]
        plt.close("all")


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
