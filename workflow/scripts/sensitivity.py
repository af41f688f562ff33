from accelstudy.study.analysis import analyse_sensitivity
from accelstudy.study.config import parse_study
from accelstudy.study.job import job

with job(snakemake) as provenance:
    study = parse_study(snakemake.config)
    summary = snakemake.input[0] if snakemake.input else None
    analyse_sensitivity(
        study, snakemake.wildcards.analysis, summary, snakemake.output[0], provenance
    )
