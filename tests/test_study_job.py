"""What every job of the workflow does: its log, and how it ends on bad input and on a defect."""

import logging
import shlex
import sys
from contextlib import contextmanager
from types import SimpleNamespace

import pytest
from study_helpers import content, make_study

from accelstudy.errors import InputError
from accelstudy.study.job import job, quote_python


@contextmanager
def a_job(log, **config):
    """A job in a process that has not set up its logging."""
    handlers, level = logging.root.handlers, logging.root.level
    logging.root.handlers = []
    snakemake = SimpleNamespace(log=[str(log)], config=content(**config), rule="simulate")
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
    with a_job(log) as (study, provenance):
        logging.getLogger("accelstudy").info("at work")
    assert study == make_study()
    assert provenance == {"config_hash": study.fingerprint, "seed": 1}
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


def test_a_bad_configuration_ends_with_one_line(log, capsys):
    with pytest.raises(SystemExit) as ended, a_job(log, seed=-1):
        pytest.fail("the body must not run")
    assert ended.value.code == 2
    assert capsys.readouterr().err.startswith("error: config: seed: ")


def test_a_defect_leaves_its_traceback_in_the_log(log):
    with pytest.raises(ZeroDivisionError), a_job(log):
        raise ZeroDivisionError("a defect")
    text = log.read_text()
    assert "ERROR simulate failed" in text
    assert "ZeroDivisionError: a defect" in text


def test_the_path_of_python_may_have_a_space(monkeypatch):
    for path in ("/usr/bin/python", "/tmp/with space/bin/python"):
        monkeypatch.setattr(sys, "executable", path)
        quote_python()
        assert shlex.split(sys.executable) == [path]
