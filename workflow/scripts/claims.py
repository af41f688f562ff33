from accelstudy.jobs import job
from accelstudy.study.claims.verdicts import TABLES, judge_claims
from accelstudy.study.config import Study

with job(snakemake) as provenance:
    study = Study.model_validate(snakemake.config)
    judge_claims(
        study,
        {name: snakemake.input[name] for name in TABLES},
        dict(snakemake.output.items()),
        provenance,
    )
