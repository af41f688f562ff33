"""Walk the README and every example in the help as a stranger: an empty folder, a package."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from study_helpers import PROVENANCE

from accelstudy.cli import main
from accelstudy.schemes import get_scheme
from accelstudy.study.tables import write_table

ROOT = Path(__file__).parents[1]
README = ROOT / "README.md"


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """A folder in which the package is installed from its wheel, without any network."""
    folder = tmp_path_factory.mktemp("installed")
    python = [sys.executable, "-m"]
    wheel = ["hatchling", "build", "--target", "wheel", "--directory", folder]
    subprocess.run([*python, *wheel], cwd=ROOT, check=True, capture_output=True)
    install = ["uv", "pip", "install", "--offline", "--no-deps", "--python", sys.executable]
    (built,) = folder.glob("*.whl")
    subprocess.run([*python, *install, "--target", folder, built], check=True, capture_output=True)
    return folder


def log_csv(path):
    """A log as a logger writes it: three columns without a header; 24 holds, a turn before each."""
    rng = np.random.default_rng(1)
    rows = []
    forces = -9.81 * get_scheme("fibonacci-24").directions
    for before, after in zip(np.roll(forces, 1, axis=0), forces, strict=True):
        rows += [np.linspace(before, after, 100), np.tile(after, (400, 1))]
    readings = np.concatenate(rows) * [1.002, 0.999, 1.001] + [0.05, 0.01, 0.03]
    readings += 0.005 * rng.standard_normal(readings.shape)
    np.savetxt(path, readings, "%.5f", delimiter=",")


@pytest.fixture
def folder(tmp_path):
    """What a reader has: a log of a sensor, the configurations, and verdicts of a study."""
    shutil.copytree(ROOT / "config", tmp_path / "config")
    log_csv(tmp_path / "log.csv")
    claim = {
        "claim": "c", "section": "4.2", "statement": "it holds", "unit": "%", "paper": 50.0,
        "ours": 41.25, "ci95_low": 40.0, "ci95_high": 42.0, "verdict": "reproduced",
        "sentence": "So it is.",
    }  # fmt: skip
    path = tmp_path / "results/paper/claims.parquet"
    path.parent.mkdir(parents=True)
    write_table(path, pd.DataFrame([claim]), PROVENANCE)
    return tmp_path


def walked(source, site, folder):
    """Steps of a walk in `folder` with the package installed in `site`."""
    known = ("PATH", "HOME", "LANG", "OPENBLAS_NUM_THREADS")
    environment = {name: os.environ[name] for name in known if name in os.environ}
    environment |= {"PYTHONPATH": str(site), "MPLBACKEND": "agg"}
    environment["PATH"] = f"{site / 'bin'}:{environment['PATH']}"
    done = subprocess.run(
        [sys.executable, ROOT / "tests/walk.py", source, "steps.json"],
        cwd=folder, env=environment, capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    content = json.loads((folder / "steps.json").read_text(encoding="utf-8"))
    assert Path(content["package"]).is_relative_to(site)
    return content["steps"]


def judge(steps):
    for step in steps:
        if "skipped" not in step:
            assert step["status"] == 0, f"{step['command']}\n{step['output']}"
            assert not step["missing"], f"{step['command']} did not write {step['missing']}"


def test_readme(site, folder):
    steps = walked(README, site, folder)
    judge(steps)
    run = [step["command"] for step in steps if "skipped" not in step]
    for command in ("import", "calibrate", "apply", "export", "diagnose", "effects --campaign"):
        assert any(step.startswith(f"accelstudy {command} ") for step in run), command
    (python,) = (step for step in steps if "import " in step["command"][:7])
    assert len(re.findall(r"\d", python["output"])) > 50  # three arrays of numbers


def test_examples_of_the_help(site, folder):
    steps = walked("help", site, folder)
    judge(steps)
    assert {step["command"].split()[1] for step in steps} == set(main.commands)


def test_make_targets_and_files_of_the_readme_exist():
    text = README.read_text(encoding="utf-8")
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    targets = set(re.findall(r"(?:^    |`)make ([a-z-]+)", text, re.M)) - {"help"}
    assert {"reproduce", "test", "smoke"} <= targets
    for target in targets:
        assert re.search(rf"^{target}:", makefile, re.M), target
    for name in re.findall(r"`((?:config|benchmarks|docs|accelstudy)/[\w/.]+)`", text):
        assert (ROOT / name).exists(), name
    for name in re.findall(r"^ +(?:snakemake|accelstudy) .*?(config/[\w/.-]+)", text, re.M):
        assert (ROOT / name).exists(), name
