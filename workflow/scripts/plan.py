import os

from accelstudy.basics.units import ANGLE_UNIT_VARIABLE, angles_in
from accelstudy.jobs.job import logged
from accelstudy.plan.output import make_plan

with logged(snakemake), angles_in(os.environ.get(ANGLE_UNIT_VARIABLE)):
    given = snakemake.params
    make_plan(
        snakemake.wildcards.plan, given.case, given.replicates, given.folder, given.provenance
    )
