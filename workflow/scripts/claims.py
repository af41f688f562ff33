from accelstudy.study.analysis import judge_claims
from accelstudy.study.config import parse_study
from accelstudy.study.job import job, lists

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
