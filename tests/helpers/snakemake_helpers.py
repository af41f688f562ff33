"""Snakemake as the tests run it."""

import gc
import multiprocessing
import os
import re
import runpy
import subprocess
import sys
import warnings
from contextlib import chdir, contextmanager, nullcontext, redirect_stderr, redirect_stdout
from multiprocessing.connection import wait
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Lock

import pytest
from places import ROOT
from snakemake.benchmark import benchmarked
from snakemake.cli import main
from snakemake.script import PythonScript

SNAKEMAKE = [sys.executable, "-m", "snakemake", "--workflow-profile", ROOT / "profiles" / "default"]
ENVIRONMENT = {
    **os.environ,
    "PATH": os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]]),
    "OPENBLAS_NUM_THREADS": "1",
    "NO_COLOR": "1",
}
ENVIRONMENT.pop("SNAKEMAKE_PROFILE", None)
FORKS = multiprocessing.get_context("forkserver")
"""Processes that begin with everything imported, as copies of one that has only imported it."""
IMPORTED = {
    *("matplotlib.backends.backend_agg", "matplotlib.backends.backend_svg", "matplotlib.pyplot"),
    *("pyarrow.parquet", "scipy.optimize", "scipy.stats", "snakemake.script", "sympy"),
    *re.findall("^from (accelstudy.*) import", "\n".join(
        path.read_text("utf-8") for path in (ROOT / "workflow" / "scripts").iterdir()
    ), re.MULTILINE),
}  # fmt: skip
FORKED_JOB = str(Path(__file__).with_name("forked_job.py"))
FORKS.set_forkserver_preload(sorted(IMPORTED))
LOCK = Lock()
"""A process that starts asks all others for their exit status, which can be read only once."""
TARGETS = ("study", "campaigns", "total")
"""Lines of Snakemake's list of jobs that are no jobs."""


def snakemake(folder, *words, environment=ENVIRONMENT):
    """Run Snakemake in a folder, within this process; exit status, and both streams together.

    It is what the command calls. Jobs are processes in any case, but those of Python are forked. To
    start Python and to import everything would take ten times as long as what most of them do.
    """

    def execute_script(job, script, edit=False):
        given = {"script": os.path.abspath(script), "folder": os.getcwd(),
                 "environment": dict(os.environ), "printed": said.name}  # fmt: skip
        process = FORKS.Process(target=runpy.run_path, args=(FORKED_JOB, given))
        with LOCK:
            process.start()
        with benchmarked(process.pid, job.bench_record) if job.bench_record else nullcontext():
            wait([process.sentinel])
        with LOCK:
            process.join()
        if process.exitcode:
            raise subprocess.CalledProcessError(process.exitcode, f"python {script}")

    with (
        pytest.MonkeyPatch.context() as patch,
        chdir(folder),
        TemporaryDirectory() as place,
        open(Path(place, "printed"), "a+b") as said,  # to which this process and jobs append
    ):
        if environment.get("PYTHONPATH") == ENVIRONMENT.get("PYTHONPATH"):  # no other package
            patch.setattr(PythonScript, "execute_script", execute_script)
        for name in os.environ.keys() - environment.keys():
            patch.delenv(name)
        for name, value in environment.items():
            patch.setenv(name, value)
        patch.setattr(sys, "path", sys.path.copy())
        # Jobs print where this process does, whatever was there when Snakemake was imported.
        patch.setattr(sys.modules["snakemake.shell"], "STDOUT", None)
        with warnings.catch_warnings(), _output_to(said):
            warnings.simplefilter("ignore")
            try:
                main([str(word) for word in (*SNAKEMAKE[3:], *words)])
                status = 0
            except SystemExit as end:
                status = end.code or 0
            gc.collect()  # a temporary folder that Snakemake leaves to Python to remove
        said.seek(0)
        return subprocess.CompletedProcess(words, status, said.read().decode())


@contextmanager
def _output_to(file):
    """Let this process, and those that it starts, print to a file."""
    kept = [os.dup(number) for number in (1, 2)]
    try:
        for number in (1, 2):
            os.dup2(file.fileno(), number)
        with (
            open(os.dup(1), "w", encoding="utf-8", buffering=1) as stream,
            redirect_stdout(stream),
            redirect_stderr(stream),
        ):
            yield
    finally:
        for number, copy in zip((1, 2), kept, strict=True):
            os.dup2(copy, number)
            os.close(copy)


def jobs(text):
    """Rules with a script that a run has run, or would run, with the number of jobs."""
    counts = re.findall(r"^(\w+) +(\d+)$", text, re.MULTILINE)
    return {rule: int(count) for rule, count in counts if rule not in TARGETS}


def remains(folder):
    """Temporary files that are left."""
    return [str(path) for path in folder.rglob("*") if path.name.endswith(".part")]


def one_line(text, *parts):
    """The only line with all parts."""
    (line,) = (line for line in text.splitlines() if all(part in line for part in parts))
    return line
