"""Walk the first pages and every example in the help as a stranger: an empty folder, a package."""

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
from places import ROOT
from session_helpers import write_document
from study_helpers import PROVENANCE

from accelstudy.campaign.format import write_campaign
from accelstudy.campaign.simulated import CampaignSettings, simulate_campaign
from accelstudy.commands.main import main
from accelstudy.files.tables import write_table
from accelstudy.schemes import get_scheme

README = ROOT / "README.md"
PAGES = {
    page.name: page
    for page in (
        README,
        ROOT / "docs/index.md",
        ROOT / "docs/guides/your-sensor.md",
        ROOT / "docs/guides/missing.md",
        ROOT / "docs/reference/api/first_steps.py",
    )
}
"""Pages whose commands a reader can type one after the other."""


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


def log_csv(path, seed=1, named=False):
    """A log as a logger writes it, of 24 holds, a turn before each; or with names and times."""
    rng = np.random.default_rng(seed)
    rows = []
    forces = -9.81 * get_scheme("fibonacci-24").directions
    for before, after in zip(np.roll(forces, 1, axis=0), forces, strict=True):
        rows += [np.linspace(before, after, 100), np.tile(after, (400, 1))]
    readings = np.concatenate(rows) * [1.002, 0.999, 1.001] + [0.05, 0.01, 0.03]
    readings += 0.005 * rng.standard_normal(readings.shape)
    if named:
        readings = np.column_stack([np.arange(len(readings)) / 100, readings])
    header = "t,ax,ay,az" if named else ""
    np.savetxt(path, readings, "%.5f", delimiter=",", header=header, comments="")


@pytest.fixture(scope="module")
def walked(tmp_path_factory):
    return tmp_path_factory.mktemp("walk")


def environment_of(site):
    processor = ("OPENBLAS_CORETYPE", "NPY_DISABLE_CPU_FEATURES")
    known = ("PATH", "HOME", "LANG", "OPENBLAS_NUM_THREADS", *processor)
    environment = {name: os.environ[name] for name in known if name in os.environ}
    environment |= {"PYTHONPATH": str(site), "MPLBACKEND": "agg"}
    environment["PATH"] = f"{site / 'bin'}:{environment['PATH']}"
    return environment


@pytest.fixture(scope="module")
def steps(site, walked):
    """What came of all commands, in a folder that holds what a reader has.

    That is a log of a sensor and one of a reference beside it, two calibrations of another,
    campaigns of three and, for studies, the configurations and the verdicts of one.
    """
    folder = walked
    log_csv(folder / "log.csv")
    log_csv(folder / "calibration.csv", named=True)
    log_csv(folder / "ref.csv", seed=2, named=True)
    for seed, season in enumerate(("spring", "autumn", "winter")):
        write_document(folder / season / "calibration.json", seed)
    for seed in (1, 2, 3):
        session = simulate_campaign(CampaignSettings(seed=seed, scheme="fibonacci-18"))[0]
        write_campaign(session, folder / f"sensor-{seed}")
    shutil.copytree(ROOT / "config", folder / "config")
    claim = {
        "claim": "c", "section": "4.2", "statement": "it holds", "unit": "%", "paper": 50.0,
        "ours": 41.25, "ci95_low": 40.0, "ci95_high": 42.0, "verdict": "reproduced",
        "sentence": "So it is.",
    }  # fmt: skip
    path = folder / "results/paper/claims.parquet"
    path.parent.mkdir(parents=True)
    write_table(path, pd.DataFrame([claim]), PROVENANCE)

    done = subprocess.run(
        [sys.executable, ROOT / "tests/helpers/walk.py", "steps.json", *PAGES.values()],
        cwd=folder, env=environment_of(site), capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    content = json.loads((folder / "steps.json").read_text(encoding="utf-8"))
    assert Path(content["package"]).is_relative_to(site)
    return content["steps"]


def test_the_package_has_all_its_files(site):
    for folder in ("accelstudy", "config", "profiles", "workflow"):
        within = site if folder == "accelstudy" else site / "accelstudy" / "shipped"
        for path in (ROOT / folder).rglob("*"):
            if path.is_file() and "__pycache__" not in path.parts:
                assert (within / path.relative_to(ROOT)).read_bytes() == path.read_bytes(), path
    assert (site / "accelstudy" / "py.typed").is_file()


def test_a_new_study_runs_the_installed_workflow(site, steps, walked):
    """`accelstudy init` is among the examples of the help."""
    planned = subprocess.run(
        [sys.executable, "-m", "snakemake", "--dry-run", "--cores", "1"],
        cwd=walked / "my-study", env=environment_of(site), capture_output=True, text=True,
    )  # fmt: skip
    assert planned.returncode == 0, planned.stderr
    assert "results/my-study/figures/sweep-positions.png" in planned.stdout


@pytest.mark.parametrize("source", [*PAGES, "help"])
def test_each_command_runs_and_writes_what_it_says(steps, source):
    for step in steps:
        if step["source"] == source and "skipped" not in step:
            assert step["status"] == 0, f"{step['command']}\n{step['output']}"
            assert not step["missing"], f"{step['command']} did not write {step['missing']}"


def test_the_pages_have_what_a_reader_needs(steps):
    run = [s for s in steps if s["source"] in PAGES and "skipped" not in s]
    for command in ("import", "calibrate", "apply", "export", "diagnose", "effects --campaign"):
        assert any(s["command"].startswith(f"accelstudy {command} ") for s in run), command
    (python,) = (s for s in run if s["source"] == "first_steps.py")
    assert len(re.findall(r"\d", python["output"])) > 50  # three arrays of numbers
    (python,) = (s for s in run if s["command"].startswith("import accelstudy as acs"))
    verdict, *parameters = python["output"].splitlines()
    assert verdict in ("accepted", "rejected")
    assert any(line.startswith("b_x ") for line in parameters)


def test_the_first_example_of_a_log_needs_no_columns(steps):
    """Those by number come second; both are the same log, so nothing else differs."""
    first, second, *_ = (s for s in steps if s["command"].startswith("accelstudy import "))
    assert first["command"] == "accelstudy import calibration.csv --out my-campaign"
    assert "--columns fx=0" in second["command"]
    holds = [re.search(r"^holds: .*", s["output"], re.M)[0] for s in (first, second)]
    assert holds[0] == holds[1]
    assert holds[0].startswith("holds: 24, ")
    recognised = re.search(r"^columns: .*", first["output"], re.M)[0]
    assert f"\n{recognised}\n" in README.read_text(encoding="utf-8")


def test_each_page_that_the_readme_names_can_be_clicked():
    text = re.sub(r"```.*?```", "", README.read_text(encoding="utf-8"), flags=re.DOTALL)
    links = re.findall(r"\]\(([^)#]+)[^)]*\)", text)
    assert len(links) > 15
    assert [link for link in links if not (ROOT / link).exists()] == []
    assert re.findall(r"`[^`]*\.md`", text) == []


def test_each_help_has_an_example(steps):
    found = {s["command"].split()[1] for s in steps if s["source"] == "help"}
    assert found == set(main.commands)


def test_make_targets_and_files_of_the_readme_exist():
    """Those of the other pages are checked when the site is built."""
    text = README.read_text(encoding="utf-8")
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    targets = set(re.findall(r"(?:^ *|`)make ([a-z-]+)", text, re.M)) - {"help"}
    assert {"reproduce", "docs"} <= targets
    for target in targets:
        assert re.search(rf"^{target}:", makefile, re.M), target
    for name in re.findall(r"[`(]((?:config|benchmarks|docs|accelstudy)/[\w/.-]+)[`)]", text):
        assert (ROOT / name).exists(), name
