from accelstudy.jobs.job import job
from studies.hidden.real_noise import parse_real_noise, run_log

with job(snakemake) as provenance:
    run_log(
        parse_real_noise(snakemake.config),
        snakemake.wildcards.log,
        snakemake.output[0],
        provenance,
    )
