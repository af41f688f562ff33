from accelstudy.study.analysis import analyse_sensitivity
from accelstudy.study.job import job

with job(snakemake) as (study, provenance):
    summary = snakemake.input[0] if snakemake.input else None
    analyse_sensitivity(
        study, snakemake.wildcards.analysis, summary, snakemake.output[0], provenance
    )
