from accelstudy.jobs.job import job
from accelstudy.study.monte_carlo.simulate import simulate_batch

with job(snakemake) as provenance:
    simulate_batch(snakemake.params.spec, dict(snakemake.output.items()), provenance)
