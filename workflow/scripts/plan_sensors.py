import os

from accelstudy.plan.jobs import compare_sensors
from accelstudy.study.job import logged
from accelstudy.units import ANGLE_UNIT_VARIABLE, angles_in

with logged(snakemake), angles_in(os.environ.get(ANGLE_UNIT_VARIABLE)):
    compare_sensors(
        snakemake.params.sensors, dict(snakemake.output.items()), snakemake.params.provenance
    )
