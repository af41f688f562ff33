from snakemake.exceptions import WorkflowError

from accelstudy.basics.errors import InputError
from accelstudy.plan.config import parse_example, parse_section
from accelstudy.files.reading import read_layer
from accelstudy.files.outputs import check_writable
from accelstudy.jobs.code import code_hash

SOURCE = ", ".join(map(str, workflow.configfiles)) or "config"

try:
    if not config:
        raise InputError("nothing to plan; name it with --configfile config/plan-example.yaml")
    for path in workflow.configfiles:
        read_layer(path)  # Snakemake's own reading is less strict
    EXAMPLE = parse_example(config, SOURCE)
    RESULTS = f"results/{EXAMPLE.study}"
    check_writable(RESULTS)
except InputError as error:
    raise WorkflowError(str(error)) from None

PROVENANCE = EXAMPLE.provenance


def section(name, block):
    """A section of the configuration, checked by the class of its part."""
    try:
        return parse_section(EXAMPLE, name, block, SOURCE)
    except InputError as error:
        raise WorkflowError(str(error)) from None
