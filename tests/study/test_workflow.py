"""The workflow end to end: the same content however it is run, and bad input ends in one line."""

import os
import re
import shutil
import signal
import subprocess
import time
import zipfile
from pathlib import Path

import pandas as pd
import pyarrow.parquet as pq
import pytest
import yaml
from places import ROOT
from snakemake_helpers import ENVIRONMENT, SNAKEMAKE, one_line, remains, snakemake
from study_helpers import NINE, grid

import accelstudy
from accelstudy.basics.errors import InputError
from accelstudy.files import provenance
from accelstudy.files.outputs import check_writable
from accelstudy.files.tables import read_origin, read_table
from accelstudy.jobs.code import code_hash
from accelstudy.study import batches
from accelstudy.study.figures import get_figure
from accelstudy.study.tables import TABLES

CONFIG = ROOT / "config" / "config.yaml"

# Two models, two schemes, two approaches: eight cells, of which one cannot be estimated.
TINY = {
    "study": "tiny",
    "paper": False,
    "sensitivity": None,
    "presets": None,
    "leveling": {"attitudes": 20},
    "grids": [
        grid(["bias-scale", NINE], ["mclaren-24", "faces-6"], 60, approaches=["gravity", "robot"])
    ],
}
TABLE_PATHS = [f"results/tiny/{name}.parquet" for name in TABLES]

IN_BATCHES = f"""\
from functools import partial

from accelstudy.study import batches

batches.batches = partial(batches.batches, size=240)


include: "{ROOT}/workflow/Snakefile"


rule study:
    default_target: True
    input:
        rules.all.input,
"""
"""The workflow with two batches of four cells."""


def words(folder, *arguments, snakefile=ROOT / "Snakefile", cores=2, config=TINY):
    path = folder / "tiny.yaml"
    path.write_text(config if isinstance(config, str) else yaml.safe_dump(config))
    return [*arguments, "--snakefile", snakefile, "--cores", cores, "--configfile", CONFIG, path]


def command(folder, *arguments, **options):
    """Words of a command that runs Snakemake."""
    return [str(word) for word in (*SNAKEMAKE, *words(folder, *arguments, **options))]


def run(folder, *arguments, **options):
    return snakemake(folder, *words(folder, *arguments, **options))


def succeed(folder, *arguments, **options):
    result = run(folder, *arguments, **options)
    assert result.returncode == 0, result.stdout
    return result.stdout


def refuse(folder, *arguments, **options):
    """Run what must fail; nothing half-written is left."""
    result = run(folder, *arguments, **options)
    assert result.returncode != 0, result.stdout
    assert "Traceback" not in result.stdout
    assert remains(folder) == []
    return result.stdout


def in_batches(folder):
    path = folder / "Snakefile"
    path.write_text(IN_BATCHES)
    return path


def content(folder):
    """All tables and estimates of a finished study, as they are."""
    results = folder / "results" / "tiny"
    tables = {name: read_table(results / f"{name}.parquet") for name in TABLES}
    estimates = read_table(results / "estimates")
    labels = dict.fromkeys(("cell", "parameter", "unit"), str)  # coded by file
    return {**tables, "estimates": estimates.astype(labels)}


def assert_same(one, other):
    assert one.keys() == other.keys()
    for name, table in one.items():
        pd.testing.assert_frame_equal(table, other[name], check_exact=True)


@pytest.fixture(scope="module")
def single(tmp_path_factory):
    """The study run on one core, in one batch, with everything that `all` asks for."""
    folder = tmp_path_factory.mktemp("single")
    succeed(folder, cores=1)
    return folder


@pytest.fixture
def finished(single, tmp_path):
    """A copy of the finished study, with Snakemake's records of it."""
    return Path(shutil.copytree(single, tmp_path / "copy"))


# --- the same content ----------------------------------------------------------------------------


def test_all_is_made(single):
    results = single / "results" / "tiny"
    for name in TABLES:
        table = read_table(results / f"{name}.parquet")
        assert table["cell"].nunique() == (8 if name in ("cells", "summary") else 7)
    estimates = read_table(results / "estimates")
    assert len(estimates) == 60 * (2 * 2 * 6 + 9 + 2 * 9)
    hashes = {read_origin(path)["config_hash"] for path in results.rglob("*.parquet")}
    assert len(hashes) == 1
    assert not list(results.glob("claims*"))
    assert (results / "logs" / "simulate" / "0000.log").read_text().count(" replicates, ") == 7
    assert remains(single) == []
    page = (results / "explorer.html").read_text(encoding="utf-8")
    links = re.findall(r'href="(figures/[^"]+)"', page)
    assert {results / link for link in links} == {*results.glob("figures/*.svg")}


def test_a_second_run_does_nothing(single):
    before = {path: path.stat().st_mtime_ns for path in (single / "results").rglob("*")}
    assert "Nothing to be done" in succeed(single)
    assert {path: path.stat().st_mtime_ns for path in (single / "results").rglob("*")} == before


def test_killed_and_resumed(single, tmp_path, monkeypatch):
    """In batches, on two cores, in two runs: what comes out is the same."""
    monkeypatch.setattr(batches, "batches", batches.batches)  # which the workflow replaces
    snakefile = in_batches(tmp_path)
    estimates = tmp_path / "results" / "tiny" / "estimates"
    with subprocess.Popen(
        command(tmp_path, *TABLE_PATHS, snakefile=snakefile),
        cwd=tmp_path, env=ENVIRONMENT, start_new_session=True,
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    ) as process:  # fmt: skip
        while not list(estimates.glob("[0-9]*.parquet")):
            assert process.poll() is None
            time.sleep(0.02)
        os.killpg(process.pid, signal.SIGKILL)
    assert process.returncode == -signal.SIGKILL
    assert not any((tmp_path / path).exists() for path in TABLE_PATHS)
    assert len(read_table(estimates)) > 0  # what is there is whole

    locked = run(tmp_path, *TABLE_PATHS, snakefile=snakefile)
    assert locked.returncode != 0
    one_line(locked.stdout, "results/tiny is locked", "`make unlock`")
    succeed(tmp_path, "--unlock", snakefile=snakefile)
    succeed(tmp_path, *TABLE_PATHS, snakefile=snakefile)
    assert len(list(estimates.iterdir())) == 2
    assert_same(content(tmp_path), content(single))
    for path in TABLE_PATHS:
        assert pq.read_schema(tmp_path / path).equals(pq.read_schema(single / path))
    assert remains(tmp_path) == []


# --- what runs again -----------------------------------------------------------------------------


def planned(folder, config=TINY):
    """Rules that a dry run would run, with the number of jobs."""
    text = succeed(folder, "--dry-run", config=config)
    counts = re.findall(r"^(\w+) +(\d+)$", text.split("Reasons:")[0], re.MULTILINE)
    return {rule: int(count) for rule, count in counts if rule not in ("study", "total")}


def test_dry_run(tmp_path):
    plan = planned(tmp_path)
    assert plan == {"simulate": 1, "summarise": 1, "collect": 1, "figures": 1, "explorer": 1}
    assert not (tmp_path / "results").exists()


def test_other_attitudes_do_not_simulate_again(finished):
    plan = planned(finished, config={**TINY, "leveling": {"attitudes": 30}})
    assert "summarise" in plan
    assert "simulate" not in plan


@pytest.fixture(scope="module")
def copied(tmp_path_factory):
    """A copy of the package."""
    copy = tmp_path_factory.mktemp("package") / "accelstudy"
    no_caches = shutil.ignore_patterns("__pycache__")
    return Path(shutil.copytree(accelstudy.__path__[0], copy, ignore=no_caches))


@pytest.fixture
def edit(copied, monkeypatch):
    """Edit a file of the package, as far as what runs again is concerned."""
    monkeypatch.setattr(accelstudy, "__file__", str(copied / "__init__.py"))
    edited = {}

    def append(name):
        path = copied / name
        edited[path] = path.read_text(encoding="utf-8")
        path.write_text(edited[path] + "\n# an edit\n", encoding="utf-8")

    yield append
    for path, content in edited.items():
        path.write_text(content, encoding="utf-8")


def test_an_edit_of_the_package_runs_what_depends_on_it(finished, edit):
    edit("drawing/style.py")
    assert planned(finished).keys() == {"explorer", "figures"}
    edit("effects/bias.py")
    assert planned(finished).keys() >= {"simulate", "summarise", "collect", "figures"}


STAGES = ("simulate", "summarise", "sensitivity", "claims", "figures")
SEVERAL = {*STAGES}


def hash_of(stage):
    return code_hash(ROOT / "workflow" / "scripts" / f"{stage}.py")


@pytest.mark.parametrize(
    ("name", "stages"),
    [
        ("effects/bias.py", SEVERAL),
        ("approaches/robot.py", SEVERAL),
        ("schemes/mclaren.py", SEVERAL),
        ("adjustment/gauss_helmert.py", SEVERAL),
        ("simulation/sessions.py", SEVERAL),
        ("noise_effects/base.py", SEVERAL),
        ("simulation/hold_plan.py", SEVERAL),
        ("study/config/schema.py", {"sensitivity", "claims", "figures"}),
        ("study/monte_carlo/simulate.py", {"simulate"}),
        ("study/monte_carlo/distributions.py", {"summarise", "claims"}),
        ("leveling/error.py", SEVERAL),
        ("leveling/sensitivity.py", {"sensitivity", "claims", "figures"}),
        ("design/closed_forms.py", {"summarise"}),
        ("drawing/style.py", {"figures"}),
        ("study/figures/sweep.py", {"figures"}),
        ("study/claims/base.py", {"claims"}),
        ("study/claims/page.html.j2", {"claims"}),
        ("pages/base.html.j2", {"claims"}),
        ("commands/main.py", set()),
        ("commands/catalogue.py", set()),
        ("jobs/earlier.py", set()),
        ("campaign/gross_errors/base.py", set()),
    ],
)
def test_hash_of_the_code_that_a_stage_uses(name, stages, hashes, edit):
    edit(name)
    assert {stage for stage in STAGES if hash_of(stage) != hashes[stage]} == stages


@pytest.fixture(scope="module")
def hashes(copied):
    """Of each stage, as the code is; where the package lies makes no difference."""
    before = {stage: hash_of(stage) for stage in STAGES}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(accelstudy, "__file__", str(copied / "__init__.py"))
        assert {stage: hash_of(stage) for stage in STAGES} == before
    return before


def test_a_new_file_counts_everywhere(hashes, copied, edit):
    new = copied / "effects" / "new.py"
    new.write_text("")
    after = {stage: hash_of(stage) for stage in STAGES}
    new.unlink()
    assert all(after[stage] != hashes[stage] for stage in STAGES)


# --- bad input -----------------------------------------------------------------------------------


def test_unknown_key_on_the_command_line(tmp_path):
    text = refuse(tmp_path, "--config", "seeed=1")
    one_line(text, "tiny.yaml: seeed: unknown key; did you mean 'seed'?", "known: study, seed")
    assert not (tmp_path / "results").exists()


def test_paper_without_what_it_needs(tmp_path):
    text = refuse(tmp_path, config={**TINY, "paper": True})
    one_line(text, "tiny.yaml: paper: true needs the block `sensitivity`")


def test_a_key_twice(tmp_path):
    text = refuse(tmp_path, config="study: a\nseed: 1\nstudy: b\n")
    one_line(text, "tiny.yaml: not valid YAML: line 3, column 1: the key 'study' stands twice")


def test_results_is_a_file(tmp_path):
    (tmp_path / "results").write_text("not a folder")
    text = refuse(tmp_path)
    one_line(text, "results/tiny: cannot hold results: ", f"{tmp_path}/results is not a folder")
    assert (tmp_path / "results").read_text() == "not a folder"


def test_results_cannot_be_written(tmp_path, monkeypatch):
    closed = tmp_path / "closed"
    closed.mkdir(mode=0o500)
    if os.geteuid() == 0:  # whom permission bits do not bind
        monkeypatch.setattr(provenance.os, "access", lambda path, mode: Path(path) != closed)
    for folder in (closed / "a" / "b", closed, tmp_path):
        expected = re.escape(f"{folder}: cannot hold results: {closed} is not writable")
        with pytest.raises(InputError, match=f"^{expected}$"):
            check_writable(folder)
    check_writable(tmp_path / "a" / "b")
    closed.rmdir()
    check_writable(tmp_path)
    assert not (tmp_path / "a").exists()


def test_truncated_estimates(finished):
    results = finished / "results" / "tiny"
    estimates = results / "estimates" / "0000.parquet"
    whole = estimates.read_bytes()
    stamp = estimates.stat().st_mtime_ns
    estimates.write_bytes(whole[: len(whole) // 2])
    os.utime(estimates, ns=(stamp, stamp))
    text = refuse(finished, *TABLE_PATHS)
    name = "results/tiny/estimates/0000.parquet"
    one_line(text, f"{name}: not a whole Parquet file", "delete it and run again")

    # And so it is, though no table asks for it.
    estimates.unlink()
    assert "simulate" in planned(finished)
    succeed(finished, name)
    assert estimates.read_bytes() == whole


# --- around it -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("snakefile", "config"),
    [
        ("Snakefile", "config"),
        ("workflow/campaigns.smk", "campaigns"),
        ("workflow/diagnose.smk", "diagnose-example"),
        ("workflow/hidden.smk", "hidden-effects"),
        ("workflow/plan.smk", "plan-example"),
    ],
)
def test_lint(snakefile, config, tmp_path):
    given = ["--snakefile", ROOT / snakefile, "--configfile", ROOT / f"config/{config}.yaml"]
    assert "Congratulations" in snakemake(tmp_path, "--lint", *given).stdout


def test_report(finished):
    succeed(finished, "--report", "report.zip")
    with zipfile.ZipFile(finished / "report.zip") as archive:
        assert archive.testzip() is None
        names = archive.namelist()
        (page,) = (name for name in names if name.endswith("report.html"))
        text = archive.read(page).decode()
    figures = [*(finished / "results" / "tiny" / "figures").glob("*.svg")]
    for figure in figures:
        assert figure.name in text
        assert get_figure(figure.stem).title in text
        assert get_figure(figure.stem).category in text
    assert "closed-forms" in {figure.stem for figure in figures}
    assert "Empirical standard deviation of each parameter" in text  # its caption
    assert "1 mgon = 0.0009" in text  # what a caption says of the study
