from accelstudy.jobs.job import job, lists
from accelstudy.study.config import parse_study
from accelstudy.study.results.judging import judge_claims

with job(snakemake) as provenance:
    study = parse_study(snakemake.config)
    judge_claims(
        study,
        lists(snakemake.input),
        snakemake.input.correlations,
        snakemake.input.sensitivity,
        snakemake.input.shapley,
        dict(snakemake.output.items()),
        provenance,
    )
