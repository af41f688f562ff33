from accelstudy.study.job import job
from accelstudy.study.simulate import simulate_batch

with job(snakemake) as provenance:
    simulate_batch(snakemake.params.spec, dict(snakemake.output.items()), provenance)
