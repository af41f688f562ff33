from accelstudy.study.job import job
from accelstudy.study.summary import summarise_batch

with job(snakemake) as (_, provenance):
    summarise_batch(
        snakemake.params.spec,
        snakemake.input.estimates,
        snakemake.input.correlations,
        snakemake.params.leveling,
        dict(snakemake.output.items()),
        provenance,
    )
