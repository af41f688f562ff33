# What every workflow starts with; it is included after `configfile`.
import os
import re
import sys
from contextlib import contextmanager
from operator import attrgetter

from snakemake.utils import min_version

from accelstudy.basics.errors import InputError
from accelstudy.basics.units import attitude_unit
from accelstudy.files.outputs import check_writable
from accelstudy.files.reading import read_layer
from accelstudy.jobs import code_version, killed_notice

min_version("9.10")
os.environ.update(
    MPLBACKEND="agg",  # figures of jobs go to files, whatever the user looks at
    # Memory that a job frees stays its own (glibc): to get it anew takes a sixth of a large cell's time.
    MALLOC_MMAP_MAX_="0",
    MALLOC_TRIM_THRESHOLD_=str(2**40),
)

SOURCE = ", ".join(map(str, workflow.configfiles)) or "config"


onerror:
    if notice := killed_notice(log):
        logger.error(notice)


@contextmanager
def in_a_line():
    """End with one line on what is wrong with the input, and exit status 2, as the commands do."""
    try:
        yield
    except InputError as error:
        # Snakemake would print an error of its own with a traceback.
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)


# Unit of angles on pages, where the configuration names none.
angle_unit = in_a_line()(attitude_unit)


@in_a_line()
def configured(parse, name):
    """The checked configuration, and the folder of the results, which has the name at a key of it."""
    for path in workflow.configfiles:
        read_layer(path)  # Snakemake's own reading is less strict
    checked = parse(config, SOURCE)
    results = f"results/{attrgetter(name)(checked)}"
    check_writable(results)
    return checked, results


def one_of(names):
    """Pattern of a wildcard that is one of some names."""
    return "|".join(map(re.escape, dict.fromkeys(names)))
