from accelstudy.study.analysis import analyse_shapley
from accelstudy.study.job import job

with job(snakemake) as (study, provenance):
    analyse_shapley(
        study,
        snakemake.input.summary,
        snakemake.input.correlations,
        snakemake.output[0],
        provenance,
    )
