"""The workflow end to end: the same content however it is run, and bad input ends in one line."""

import os
import re
import shutil
import signal
import subprocess
import time
import zipfile
from pathlib import Path
from textwrap import dedent

import pandas as pd
import pyarrow.parquet as pq
import pytest
import yaml
from calling import refused
from places import ROOT
from snakemake_helpers import ENVIRONMENT, SNAKEMAKE, jobs, one_line, remains, snakemake

import accelstudy
import accelstudy.jobs as jobs_of_package
from accelstudy.files import outputs
from accelstudy.files.outputs import check_writable
from accelstudy.files.reading import read_layer
from accelstudy.files.tables import read_origin, read_table
from accelstudy.study.config import parse_study
from accelstudy.study.figures import figure_names, get_figure
from accelstudy.study.tables import TABLES

TINY = read_layer(ROOT / ".test" / "config" / "config.yaml")
"""Eight cells, of which one cannot be estimated."""
MODELS = TINY["grids"][0]["models"]
TABLE_PATHS = [f"results/tiny/{name}.parquet" for name in TABLES]

SET_UPS = [f"{model}/{approach}" for model in MODELS for approach in ("gravity", "robot")]
"""What a job simulates."""
OUTER = """\
rule part:
    output: "{part}.txt"
    shell: "echo {wildcards.part} > {output}"
rule study:
    default_target: True
    input:
        rules.leveling_all.input,
        table=rules.leveling_collect.output.cells,
        parts=expand("{part}.txt", part=config["parts"]),
    output: report("done.txt", category="Outer")
    shell: "cp {input.parts} {output} && test -s {input.table}"
"""
"""What uses the workflow as a part of another one, as the guide to configurations has it."""


def words(folder, *arguments, snakefile=ROOT / "Snakefile", cores=2, config=TINY):
    path = folder / "tiny.yaml"
    path.write_text(config if isinstance(config, str) else yaml.safe_dump(config))
    return [*arguments, "--snakefile", snakefile, "--cores", cores, "--configfile", path]


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


def content(folder):
    """All tables and estimates of a finished study, as they are."""
    results = folder / "results" / "tiny"
    tables = {name: read_table(results / f"{name}.parquet") for name in TABLES}
    estimates = read_table(results / "estimates")
    labels = dict.fromkeys(("cell", "parameter", "unit"), str)  # coded by file
    return {**tables, "estimates": estimates.astype(labels)}


@pytest.fixture(scope="module")
def single(tmp_path_factory):
    """The study run on one core, with everything that `all` asks for."""
    folder = tmp_path_factory.mktemp("single")
    succeed(folder, cores=1)
    return folder


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
    drawn = {path.stem for path in results.glob("figures/*.svg")}
    assert drawn == {*figure_names(parse_study(TINY))}
    estimates = results.glob("estimates/**/*.parquet")
    assert {p.relative_to(results / "estimates").with_suffix("").as_posix() for p in estimates} == {
        *SET_UPS
    }
    logs = [(results / "logs" / "simulate" / f"{name}.log").read_text() for name in SET_UPS]
    assert sum(log.count(" replicates converged") for log in logs) == 7
    (said, *_) = sorted((single / ".snakemake" / "log").iterdir())
    assert "localrule" not in said.read_text()  # each rule has a message
    assert remains(single) == []


def test_a_second_run_does_nothing(single):
    before = {path: path.stat().st_mtime_ns for path in (single / "results").rglob("*")}
    assert "Nothing to be done" in succeed(single)
    assert {path: path.stat().st_mtime_ns for path in (single / "results").rglob("*")} == before


def test_a_study_in_memory_has_the_same_tables(single):
    tables = accelstudy.run_study(ROOT / ".test" / "config" / "config.yaml")
    assert [*tables] == [*TABLES]
    for name, table in tables.items():
        written = read_table(single / "results" / "tiny" / f"{name}.parquet")
        pd.testing.assert_frame_equal(table, written, check_exact=True)


def test_killed_and_resumed(single, tmp_path):
    """On two cores, in two runs: the same comes out, beside a hidden folder of the first."""
    estimates = tmp_path / "results" / "tiny" / "estimates"
    with subprocess.Popen(
        [*map(str, (*SNAKEMAKE, *words(tmp_path, *TABLE_PATHS)))],
        cwd=tmp_path, env=ENVIRONMENT, start_new_session=True,
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    ) as process:  # fmt: skip
        while not list(estimates.glob("*/[a-z]*.parquet")):
            assert process.poll() is None
            time.sleep(0.02)
        os.killpg(process.pid, signal.SIGKILL)
    assert process.returncode == -signal.SIGKILL
    assert not any((tmp_path / path).exists() for path in TABLE_PATHS)
    assert len(read_table(estimates)) > 0  # what is there is whole

    locked = run(tmp_path, *TABLE_PATHS)
    assert locked.returncode != 0
    assert "--unlock" in locked.stdout
    succeed(tmp_path, "--unlock")
    succeed(tmp_path, *TABLE_PATHS)
    assert len(list(estimates.glob("*/[a-z]*"))) == len(SET_UPS)
    written = content(tmp_path)
    for name, table in content(single).items():
        pd.testing.assert_frame_equal(written[name], table, check_exact=True)
    for path in TABLE_PATHS:
        assert pq.read_schema(tmp_path / path).equals(pq.read_schema(single / path))


# --- what runs again -----------------------------------------------------------------------------


def planned(folder, *arguments, **options):
    """Rules that a dry run would run, with the number of jobs."""
    return jobs(succeed(folder, "--dry-run", *arguments, **options))


def test_another_unit_of_angles_draws_again(single, monkeypatch):
    monkeypatch.setitem(ENVIRONMENT, "ACCELSTUDY_ANGLE_UNIT", "deg")
    assert planned(single).keys() == {"page", "figure"}


@pytest.mark.parametrize(("file", "anew"), [
    ("drawing/style.py", {"page", "figure"}),
    ("leveling/error.py", {"simulate", "collect", "page", "figure"}),
])  # fmt: skip
def test_an_edit_of_the_package_runs_what_depends_on_it(file, anew, single, tmp_path, monkeypatch):
    copy = Path(shutil.copytree(accelstudy.__path__[0], tmp_path / "accelstudy"))
    with (copy / file).open("a") as edited:
        edited.write("# an edit\n")
    monkeypatch.setattr(jobs_of_package, "__file__", str(copy / "jobs" / "__init__.py"))
    assert planned(single).keys() == anew


def test_another_leveling_simulates_anew_and_a_further_model_alone(single):
    assert "simulate" in planned(single, config={**TINY, "leveling": {"attitudes": 30}})
    grid = {**TINY["grids"][0], "models": [*MODELS, "bias-scale-nonorthogonality-cubic"]}
    assert planned(single, config={**TINY, "grids": [grid]})["simulate"] == 2


def test_one_figure_is_drawn_alone(single):
    figure = "results/tiny/figures/leveling-overview.png"
    assert planned(single, figure, "--forcerun", figure) == {"figure": 1}


# --- bad input -----------------------------------------------------------------------------------


def test_what_cannot_be_used_is_one_line(tmp_path):
    """The rules of configurations are those of `accelstudy cells`."""
    said = "seeed: unknown key; did you mean 'seed'? (known: plugins, study, seed"
    one_line(refuse(tmp_path, "--config", "seeed=1"), "tiny.yaml: ", said)
    assert not (tmp_path / "results").exists()


def test_results_is_a_file(tmp_path):
    (tmp_path / "results").write_text("not a folder")
    text = refuse(tmp_path)
    one_line(text, "results/tiny: cannot hold results: ", f"{tmp_path}/results is not a folder")
    assert (tmp_path / "results").read_text() == "not a folder"


def test_results_cannot_be_written(tmp_path, monkeypatch):
    check_writable(tmp_path / "a" / "b")
    monkeypatch.setattr(outputs.os, "access", lambda *_: False)
    with refused(f"{tmp_path}/a/b: cannot hold results: {tmp_path} is not writable"):
        check_writable(tmp_path / "a" / "b")
    assert not (tmp_path / "a").exists()


# --- around it -----------------------------------------------------------------------------------


@pytest.mark.parametrize(("snakefile", "config"), [
    ("Snakefile", "config/config"),
    ("studies/hidden/hidden.smk", "studies/hidden/config/hidden-effects"),
    ("studies/hidden/hidden.smk", "studies/hidden/config/real-noise"),
])  # fmt: skip
def test_lint(snakefile, config, tmp_path):
    given = ["--snakefile", ROOT / snakefile, "--configfile", ROOT / f"{config}.yaml"]
    result = snakemake(tmp_path, "--lint", *given)
    assert result.returncode == 0, result.stdout
    assert "Congratulations" in result.stdout


def check_report(folder, results):
    """Check that a report has all figures with titles and captions."""
    with zipfile.ZipFile(folder / "report.zip") as archive:
        assert archive.testzip() is None
        names = archive.namelist()
        (page,) = (name for name in names if name.endswith("report.html"))
        text = archive.read(page).decode()
    figures = [*(results / "figures").glob("*.svg")]
    for figure in figures:
        assert figure.name in text
        assert get_figure(figure.stem).title in text
        assert get_figure(figure.stem).category in text
    assert "leveling-overview" in {figure.stem for figure in figures}
    assert "decide by it where one calibration must do" in text  # its caption
    assert "1 mgon = 0.0009" in text  # what a caption says of the study


def test_a_module_with_a_prefix(single, tmp_path):
    """All is in the folder of the prefix; a job finds its tables and figures there."""
    guide = (ROOT / "docs/guides/configuration.md").read_text("utf-8")
    module = re.search(r"    from accelstudy(.*\n)*?(?=`snakefile`)", guide)[0]
    outer = tmp_path / "outer"
    shutil.copytree(single / "results", outer / "leveling" / "results")
    results = outer / "leveling" / "results" / "tiny"
    (results / "explorer.html").unlink()
    (outer / "Snakefile").write_text(f"{dedent(module)}{OUTER}")
    (outer / "my-study.yaml").write_text(yaml.safe_dump({"parts": ["a"], "leveling": TINY}))
    for words in ([], ["--report", "report.zip"]):
        result = snakemake(outer, "--cores", 1, *words)
        assert result.returncode == 0, result.stdout
    assert (outer / "done.txt").read_text() == "a\n"
    assert not (outer / "results").exists()
    check_report(outer, results)
