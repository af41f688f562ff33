"""What every job of the workflow does: its log, and how it ends on bad input and on a defect."""

import errno
import logging
import re
import subprocess
import sys
from contextlib import contextmanager
from types import SimpleNamespace

import pytest
from places import ROOT
from study_helpers import make_study

from accelstudy import jobs
from accelstudy.basics.errors import InputError
from accelstudy.files.reading import config_hash
from accelstudy.jobs import code_version, job, killed_notice


@contextmanager
def a_job(log, **config):
    """A job in a process that has not set up its logging."""
    handlers, level = logging.root.handlers, logging.root.level
    logging.root.handlers = []
    snakemake = SimpleNamespace(
        log=[str(log)], config=make_study(**config).model_dump(mode="json"), rule="simulate",
        output=["results/tiny/summary.parquet"], params={},
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
    assert provenance == {
        "config_hash": config_hash(make_study().model_dump(mode="json")),
        "seed": 1,
    }
    assert log.read_text().rstrip().endswith("INFO at work")
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(("error", "message"), [
    (InputError("table.parquet: no such file"), "table.parquet: no such file"),
    (MemoryError(), "simulate: not enough memory; run fewer jobs at once (--cores 1, or"),
    (OSError(errno.ENOSPC, "Error writing. Detail: [errno 28] No space left on device"),
     "results/tiny/summary.parquet: cannot be written: No space left on device; free some "
     "space and run again"),
    (OSError(errno.EROFS, "Read-only file system", "results/tiny/.accelstudy-1.part"),
     "results/tiny/summary.parquet: cannot be written: Read-only file system; make it"),
])  # fmt: skip
def test_bad_input_and_what_the_machine_lacks_are_one_line(error, message, log, capsys):
    with pytest.raises(SystemExit) as ended, a_job(log):
        raise error
    assert ended.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"error: {message}")
    assert f"ERROR {message}" in log.read_text()
    assert "Traceback" not in log.read_text()


@pytest.mark.parametrize("said", ["died with <Signals.SIGKILL: 9>.", "exit status 137."])
def test_a_killed_job_is_one_line(said, tmp_path):
    log = tmp_path / "snakemake.log"
    log.write_text(f"Command 'python tmp1.simulate.py' returned non-zero {said}\n")
    assert "--cores 1" in killed_notice([str(log)])
    log.write_text("Command 'python tmp1.simulate.py' returned non-zero exit status 2.\n")
    assert killed_notice([str(log)]) is None
    assert killed_notice([]) is None  # Snakemake could write none


def test_a_defect_leaves_its_traceback_in_the_log(log):
    with pytest.raises(ZeroDivisionError), a_job(log):
        raise ZeroDivisionError("a defect")
    text = log.read_text()
    assert "ERROR simulate failed" in text
    assert "ZeroDivisionError: a defect" in text


# --- what makes results anew ---------------------------------------------------------------------


def test_the_version_of_code_changes_with_code_and_nothing_else(monkeypatch, tmp_path):
    package = tmp_path / "accelstudy"
    for name in ("jobs/__init__.py", "study/cell.py", "drawing/style.py", "drawing/page.html.j2"):
        (package / name).parent.mkdir(parents=True, exist_ok=True)
        (package / name).write_text("")
    monkeypatch.setattr(jobs, "__file__", str(package / "jobs" / "__init__.py"))

    def versions():
        return code_version(), code_version(without=["drawing"]), code_version(tmp_path / "beside")

    first = versions()
    (package / "notes.txt").write_text("no code")
    assert versions() == first
    (package / "drawing" / "page.html.j2").write_text("another look")
    second = versions()
    assert [a == b for a, b in zip(first, second, strict=True)] == [False, True, False]
    (tmp_path / "beside").mkdir()
    (tmp_path / "beside" / "more.py").write_text("")
    assert [a == b for a, b in zip(second, versions(), strict=True)] == [True, True, False]


def left_out(snakefile, name):
    """Modules whose code the version of numbers leaves out, as a workflow lists their rooms."""
    text = (ROOT / snakefile).read_text(encoding="utf-8")
    (rooms,) = re.findall(rf'^{name} = "(.+)"$', text, re.MULTILINE)
    assert all((ROOT / "accelstudy" / room).is_dir() for room in rooms.split())
    rooms = [*rooms.split(), "study/figures", "study/explorer"]
    return [f"accelstudy.{room.replace('/', '.')}" for room in rooms]


SIMULATE = "accelstudy.jobs, accelstudy.study.tables"
SENSITIVITY = f"{SIMULATE}, accelstudy.study.sensitivity"
START = "accelstudy.jobs, accelstudy.study.config, accelstudy.study.figures"


@pytest.mark.parametrize(("modules", "unused"), [
    # Numbers hang on no code that their version leaves out.
    (SENSITIVITY, left_out("workflow/Snakefile", "NO_NUMBERS")),
    ("studies.hidden.campaigns", left_out("studies/hidden/hidden.smk", "UNUSED")),
    # Jobs and the start of the workflow load no more than they need.
    (SIMULATE, ["pydantic", "matplotlib", "jinja2", "scipy.special"]),
    (START, ["matplotlib", "pandas", "scipy.special"]),
], ids=["numbers", "hidden", "simulate", "start"])  # fmt: skip
def test_what_is_not_used_is_not_loaded(modules, unused):
    code = f"import sys, {modules}\nprint([x for x in sys.modules if x.startswith({(*unused,)})])"
    words = [sys.executable, "-c", code]
    ran = subprocess.run(words, capture_output=True, text=True, check=True, cwd=ROOT)
    assert ran.stdout.strip() == "[]"
