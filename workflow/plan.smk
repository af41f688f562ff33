# Plan calibrations for a required tilt accuracy: sensor, positions and time:
# snakemake --cores 2 --snakefile workflow/plan.smk --configfile config/plan-example.yaml
from accelstudy.planning.config import parse_example, parse_section


include: "rules/start.smk"


EXAMPLE, RESULTS = configured(
    parse_example, "study", "nothing to plan; name it with --configfile config/plan-example.yaml"
)
VERSION = code_version()
OUTPUTS = []
section = in_a_line()(parse_section)

# The rules of a section add their files to OUTPUTS.
for name in EXAMPLE.sections:

    include: f"rules/{name}.smk"


rule plan_example:
    default_target: True
    input:
        OUTPUTS,
