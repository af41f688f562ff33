from accelstudy.jobs.job import job, lists
from accelstudy.study.claims.judging import judge_claims
from accelstudy.study.config import StudyConfig

with job(snakemake) as provenance:
    study = StudyConfig.model_validate(snakemake.config)
    judge_claims(
        study,
        lists(snakemake.input),
        snakemake.input.correlations,
        snakemake.input.sensitivity,
        snakemake.input.shapley,
        dict(snakemake.output.items()),
        provenance,
    )
