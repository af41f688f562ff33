from accelstudy.jobs.job import job
from accelstudy.planning.comparison import compare_sensors

with job(snakemake) as provenance:
    compare_sensors(snakemake.params.sensors, dict(snakemake.output.items()), provenance)
