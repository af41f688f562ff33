import os

from accelstudy.plan.jobs import make_plan
from accelstudy.study.job import logged
from accelstudy.units import ANGLE_UNIT_VARIABLE, angles_in

with logged(snakemake), angles_in(os.environ.get(ANGLE_UNIT_VARIABLE)):
    given = snakemake.params
    make_plan(
        snakemake.wildcards.plan, given.case, given.replicates, given.folder, given.provenance
    )
