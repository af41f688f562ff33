from accelstudy.study.analysis import judge_claims
from accelstudy.study.job import job

with job(snakemake) as (study, provenance):
    judge_claims(
        study,
        snakemake.input.estimates,
        snakemake.input.correlations,
        snakemake.input.sensitivity,
        dict(snakemake.output.items()),
        provenance,
    )
