from accelstudy.jobs.job import job
from studies.hidden.baselines import run_baselines
from studies.hidden.cells import planned
from studies.hidden.config import parse_hidden

with job(snakemake) as provenance:
    run_baselines(
        parse_hidden(snakemake.config),
        planned(snakemake.input[0], int(snakemake.wildcards.chunk)),
        snakemake.output[0],
        provenance,
    )
