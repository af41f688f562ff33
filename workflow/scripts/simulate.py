from accelstudy.jobs.job import job
from accelstudy.study.batches import simulate_batch

with job(snakemake) as provenance:
    simulate_batch(snakemake.params.spec, dict(snakemake.output.items()), provenance)
