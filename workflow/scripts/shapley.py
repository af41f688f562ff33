from accelstudy.study.analysis import analyse_shapley
from accelstudy.study.config import parse_study
from accelstudy.study.job import job

with job(snakemake) as provenance:
    study = parse_study(snakemake.config)
    analyse_shapley(
        study,
        snakemake.input.summary,
        snakemake.input.correlations,
        snakemake.output[0],
        provenance,
    )
