from accelstudy.jobs.job import job, lists
from accelstudy.study.summary import summarise_batch

with job(snakemake) as provenance:
    summarise_batch(
        snakemake.params.spec,
        lists(snakemake.input),
        snakemake.params.leveling,
        dict(snakemake.output.items()),
        provenance,
    )
