"""What every job of the workflow does: its log, and how it ends on bad input and on a defect."""

import errno
import logging
import shlex
import sys
from contextlib import contextmanager, nullcontext
from types import SimpleNamespace

import pandas as pd
import pytest
from study_helpers import make_study

from accelstudy.basics.errors import InputError
from accelstudy.files.tables import write_table
from accelstudy.jobs.job import job, killed_notice, prepare_jobs, setup_digest


@contextmanager
def a_job(log, inputs=(), params=None, **config):
    """A job in a process that has not set up its logging."""
    handlers, level = logging.root.handlers, logging.root.level
    logging.root.handlers = []
    snakemake = SimpleNamespace(
        log=[str(log)], config=make_study(**config).model_dump(mode="json"), rule="simulate",
        input=[str(path) for path in inputs], output=["results/tiny/summary.parquet"],
        params=params or {},
    )  # fmt: skip
    try:
        with job(snakemake) as given:
            yield given
    finally:
        for handler in logging.root.handlers:
            handler.close()
        logging.root.handlers = handlers
        logging.root.setLevel(level)


@pytest.fixture
def log(tmp_path):
    return tmp_path / "job.log"


def test_a_job(log, capsys):
    with a_job(log) as provenance:
        logging.getLogger("accelstudy").info("at work")
    assert provenance == {"config_hash": make_study().fingerprint, "seed": 1}
    assert log.read_text().rstrip().endswith("INFO at work")
    assert capsys.readouterr().err == ""


def test_bad_input_ends_with_one_line(log, capsys):
    with pytest.raises(SystemExit) as ended, a_job(log):
        raise InputError("table.parquet: no such file")
    assert ended.value.code == 2
    assert capsys.readouterr().err == "error: table.parquet: no such file\n"
    text = log.read_text()
    assert text.rstrip().endswith("ERROR table.parquet: no such file")
    assert "Traceback" not in text


@pytest.mark.parametrize(("error", "message"), [
    (MemoryError(), "simulate: not enough memory; run fewer jobs at once (--cores 1, or"),
    (OSError(errno.ENOSPC, "Error writing. Detail: [errno 28] No space left on device"),
     "results/tiny/summary.parquet: cannot be written: No space left on device; free some "
     "space and run again"),
    (OSError(errno.EROFS, "Read-only file system", "results/tiny/.accelstudy-1.part"),
     "results/tiny/summary.parquet: cannot be written: Read-only file system; make it"),
])  # fmt: skip
def test_what_the_machine_lacks_is_one_line(error, message, log, capsys):
    with pytest.raises(SystemExit) as ended, a_job(log):
        raise error
    assert ended.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"error: {message}")
    assert "Traceback" not in log.read_text()


@pytest.mark.parametrize("said", ["died with <Signals.SIGKILL: 9>.", "exit status 137."])
def test_a_killed_job_is_one_line(said, tmp_path):
    log = tmp_path / "snakemake.log"
    log.write_text(f"Command 'python tmp1.simulate.py' returned non-zero {said}\n")
    assert "--cores 1" in killed_notice([str(log)])
    log.write_text("Command 'python tmp1.simulate.py' returned non-zero exit status 2.\n")
    assert killed_notice([str(log)]) is None
    assert killed_notice([]) is None  # Snakemake could write none


# --- what comes in -------------------------------------------------------------------------------


def test_the_set_up_of_a_batch_is_recorded(log):
    with a_job(log, params={"spec": {"seed": 1, "cells": []}}) as provenance:
        assert provenance["setup"] == setup_digest({"cells": [], "seed": 1})
    assert setup_digest({"seed": 2, "cells": []}) != provenance["setup"]


@pytest.mark.parametrize(("made", "refused"), [
    ({"seed": 1}, False),
    ({"seed": 2}, True),
    ({"seed": 1, "setup": setup_digest("this")}, False),
    ({"seed": 1, "setup": setup_digest("other")}, True),
])  # fmt: skip
def test_a_table_of_another_configuration_is_refused(made, refused, log, tmp_path, capsys):
    """As a job leaves it that outlived its run, and ended after that of the next run."""
    path = tmp_path / "estimates.parquet"
    write_table(path, pd.DataFrame({"a": [1]}), {"config_hash": "", **made})
    params = {"setups": [setup_digest("this")]}
    with pytest.raises(SystemExit) if refused else nullcontext(), a_job(log, [path], params):
        pass
    expected = f"error: {path}: is of another configuration; delete it and run again\n"
    assert capsys.readouterr().err == (expected if refused else "")


def test_a_defect_leaves_its_traceback_in_the_log(log):
    with pytest.raises(ZeroDivisionError), a_job(log):
        raise ZeroDivisionError("a defect")
    text = log.read_text()
    assert "ERROR simulate failed" in text
    assert "ZeroDivisionError: a defect" in text


def test_the_path_of_python_may_have_a_space(monkeypatch):
    for path in ("/usr/bin/python", "/tmp/with space/bin/python"):
        monkeypatch.setattr(sys, "executable", path)
        prepare_jobs()
        assert shlex.split(sys.executable) == [path]
