# What every workflow starts with; it is included after `configfile`.
import os
from contextlib import contextmanager
from operator import attrgetter

from snakemake.exceptions import WorkflowError
from snakemake.utils import min_version

from accelstudy.basics.errors import InputError
from accelstudy.basics.units import attitude_unit
from accelstudy.files.reading import read_layer
from accelstudy.files.outputs import check_writable
from accelstudy.jobs.code import code_hash
from accelstudy.jobs.earlier import earlier_run
from accelstudy.jobs.job import killed_notice, prepare_jobs

min_version("9.10")
prepare_jobs()

SOURCE = ", ".join(map(str, workflow.configfiles)) or "config"


onerror:
    if notice := killed_notice(log):
        logger.error(notice)


@contextmanager
def in_a_line():
    """Say what is wrong with the input in one line."""
    try:
        yield
    except InputError as error:
        raise WorkflowError(str(error)) from None


# Unit of angles on pages, where the configuration names none.
angle_unit = in_a_line()(attitude_unit)


@in_a_line()
def configured(parse, name, without=None):
    """The checked configuration, and the folder of the results, which has the name at a key of it.

    `without` is what to say if there is no configuration.
    """
    if without and not config:
        raise InputError(without)
    for path in workflow.configfiles:
        read_layer(path)  # Snakemake's own reading is less strict
    checked = parse(config, SOURCE)
    results = f"results/{attrgetter(name)(checked)}"
    check_writable(placed(results))
    return checked, results


@in_a_line()
def look_at_earlier(outputs, setups={}, seed=None, folders={}):
    """Check earlier results before Snakemake decides what to make.

    On a cluster, jobs read the workflow again; they skip the check.
    """
    if workflow.is_main_process:
        outputs = [placed(path) for path in outputs]
        setups, folders = ({placed(path): of[path] for path in of} for of in (setups, folders))
        for line in earlier_run(placed(RESULTS), outputs, setups, seed, folders):
            logger.warning(line)


def placed(path):
    """Where a file of this workflow is: a module of another workflow may have a prefix."""
    return str(workflow.modifier.path_modifier.replace_prefix(path))


def given(path):
    """A file of the user as an input, which no prefix moves."""
    return path if placed(path) == path else os.path.abspath(path)


def code_of(script):
    """Hash of the code that a script of the workflow runs."""
    return code_hash(workflow.source_path(f"../scripts/{script}.py"))


def megabytes(least):
    """Memory of a job; the next attempt gets more, as want of memory may have ended the last."""
    return lambda wildcards, attempt: least * attempt
