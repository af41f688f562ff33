import os

from accelstudy.basics.units import ANGLE_UNIT_VARIABLE, angles_in
from accelstudy.jobs.job import logged
from accelstudy.plan.comparison import compare_sensors

with logged(snakemake), angles_in(os.environ.get(ANGLE_UNIT_VARIABLE)):
    compare_sensors(
        snakemake.params.sensors, dict(snakemake.output.items()), snakemake.params.provenance
    )
