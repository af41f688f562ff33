# Plan calibrations for a required tilt accuracy: sensor, positions and time:
# snakemake --cores 2 --snakefile workflow/plan.smk --configfile config/plan-example.yaml
from snakemake.utils import min_version

from accelstudy.jobs.job import prepare_jobs

min_version("9.10")
prepare_jobs()


# Jobs run in the environment of the Makefile. This is for executors that need a container.
container: "docker://python:3.13-slim"


include: "rules/sections.smk"
include: "rules/plan.smk"
include: "rules/designs.smk"
include: "rules/sequential.smk"
include: "rules/pole.smk"
include: "rules/field.smk"


rule plan_example:
    default_target: True
    input:
        PLAN_OUTPUTS,
        DESIGNS_OUTPUTS,
        SEQUENTIAL_OUTPUTS,
        POLE_OUTPUTS,
        FIELD_OUTPUTS,
