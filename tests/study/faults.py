"""Kills, full and closed disks, orphans: the same command ends with the same bits, or says why not.

`make test-faults` runs this. It starts Snakemake some fifteen times, so `make test` leaves it out.
"""

import re
import shutil
import signal
import subprocess
import time
from contextlib import suppress
from pathlib import Path

import psutil
import pytest
from snakemake_helpers import ENVIRONMENT, one_line, remains
from study_helpers import NINE, grid
from test_workflow import SET_UPS, TABLE_PATHS, TINY, command, run, succeed

from accelstudy.basics.errors import InputError
from accelstudy.study.tables import read_estimates

# Eight cells in four jobs, each long enough to be caught while it writes.
STUDY = {
    **TINY,
    "grids": [grid(["bias-scale", NINE], ["mclaren-24", "faces-6"], 4000, approaches="all")],
}
FEWER = {**STUDY, "seed": 2, "grids": [{**STUDY["grids"][0], "schemes": ["mclaren-24"]}]}
ESTIMATES = Path("results/tiny/estimates")


def content(folder):
    """All tables and estimates, to the bit."""
    results = folder / "results" / "tiny"
    paths = [*results.glob("*.parquet"), *results.glob("estimates/*/*.parquet")]
    return {path.relative_to(results).as_posix(): path.read_bytes() for path in paths}


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    folder = tmp_path_factory.mktemp("whole")
    succeed(folder, *TABLE_PATHS, config=STUDY)
    return content(folder)


@pytest.fixture(scope="module")
def fewer(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fewer")
    succeed(folder, *TABLE_PATHS, config=FEWER)
    return content(folder)


def started(folder, *arguments):
    """A run that goes on in the background, and the file of what it says."""
    said = folder / "said.txt"
    with said.open("w") as file:
        words = command(folder, *TABLE_PATHS, *arguments, config=STUDY)
        process = subprocess.Popen(
            words, cwd=folder, env=ENVIRONMENT, stdout=file, stderr=subprocess.STDOUT
        )
    return process, said


def caught_job(process, writing=False):
    """A job of simulation, stopped; if asked for, while it writes estimates."""
    while process.poll() is None:
        for job in psutil.Process(process.pid).children(recursive=True):
            try:
                words = job.cmdline()
                if words[0].endswith("bash") or not words[-1].endswith(".simulate.py"):
                    continue
                job.suspend()
                if not writing or any("/estimates/" in file.path for file in job.open_files()):
                    return job
                job.resume()
            except (psutil.Error, IndexError):
                continue
        time.sleep(0.02)
    raise AssertionError("no job was caught")


@pytest.fixture
def orphans():
    """Jobs that outlived their runs; they do not outlive the test."""
    jobs = []
    yield jobs
    for job in jobs:
        with suppress(psutil.NoSuchProcess):
            job.kill()


def kill_run(folder, orphans):
    """Start a run, kill Snakemake itself, and give a job of it that is stopped while it writes."""
    process, _ = started(folder)
    orphan = caught_job(process, writing=True)
    orphans.append(orphan)
    process.send_signal(signal.SIGKILL)
    process.wait()
    for other in psutil.process_iter():  # the other job of the two cores
        try:
            if other.pid != orphan.pid and other.cwd() == str(folder):
                other.wait()
        except psutil.Error:
            continue
    return orphan


def let_end(orphan):
    orphan.resume()
    orphan.wait()


def test_killed_jobs_and_runs(whole, orphans, tmp_path):
    process, said = started(tmp_path)
    caught_job(process).kill()
    assert process.wait() != 0
    one_line(said.read_text(), "A job was killed", "goes on where this run stopped", "--cores 1")

    orphan = kill_run(tmp_path, orphans)
    locked = run(tmp_path, *TABLE_PATHS, config=STUDY)
    assert locked.returncode != 0
    assert "--unlock" in locked.stdout
    assert "Traceback" not in locked.stdout
    succeed(tmp_path, "--unlock", config=STUDY)

    # Two at once, though Snakemake would not let them, beside the stopped job of the killed run.
    pair = [started(tmp_path, "--nolock")[0] for _ in range(2)]
    assert [process.wait() in (0, 1) for process in pair] == [True, True]
    succeed(tmp_path, *TABLE_PATHS, config=STUDY)
    assert content(tmp_path) == whole
    let_end(orphan)
    succeed(tmp_path, *TABLE_PATHS, config=STUDY)
    assert content(tmp_path) == whole
    assert remains(tmp_path) == []


def test_a_job_that_outlives_its_run_and_its_configuration(fewer, orphans, tmp_path):
    orphan = kill_run(tmp_path, orphans)
    succeed(tmp_path, "--unlock", config=FEWER)
    succeed(tmp_path, *TABLE_PATHS, config=FEWER)
    assert content(tmp_path) == fewer
    let_end(orphan)  # it replaces what the run has made

    with pytest.raises(InputError, match=r"of seed \d+; delete what is not of your study"):
        read_estimates(tmp_path / ESTIMATES)
    again = run(tmp_path, *TABLE_PATHS, config=FEWER)
    assert again.returncode != 0
    one_line(again.stdout, "error: results/tiny/tables/", "delete what is not of your study")
    anew = [f"{ESTIMATES}/{name}.parquet" for name in SET_UPS]
    succeed(tmp_path, *TABLE_PATHS, "--forcerun", *anew, config=FEWER)
    assert content(tmp_path) == fewer


@pytest.fixture
def disk(tmp_path):
    """Where a disk of its own is mounted; a function that mounts it again with other options."""
    place = tmp_path / "results"
    place.mkdir()

    def mount(*options):
        words = ["mount", "-t", "tmpfs", "-o", ",".join(options), "tmpfs", place]
        return subprocess.run(words, capture_output=True, text=True, check=False)

    if shutil.which("mount") is None or mount("size=300k").returncode:
        pytest.skip("no disk can be mounted here; that takes root")
    yield lambda option: mount("remount", option)
    subprocess.run(["umount", place], check=True)


def test_a_full_and_a_closed_disk(whole, disk, tmp_path):
    full = run(tmp_path, *TABLE_PATHS, config=STUDY)
    assert full.returncode != 0
    assert re.search(
        r"^error: results/tiny/\S+: cannot be written: No space left on device; free some space "
        r"and run again$",
        full.stdout,
        re.MULTILINE,
    )
    assert "Traceback" not in full.stdout
    assert remains(tmp_path) == []

    disk("ro")
    closed = run(tmp_path, *TABLE_PATHS, config=STUDY)
    assert closed.returncode != 0
    one_line(closed.stdout, "results/tiny: cannot hold results: results/tiny is not writable")

    disk("rw,size=50m")
    succeed(tmp_path, *TABLE_PATHS, config=STUDY)
    assert content(tmp_path) == whole
