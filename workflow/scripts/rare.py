from accelstudy.jobs.job import job
from accelstudy.study.rare import rare_table

with job(snakemake) as provenance:
    rare_table(snakemake.params.spec, snakemake.output[0], provenance)
