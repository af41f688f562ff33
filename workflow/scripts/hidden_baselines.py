from accelstudy.hidden.baselines import run_baselines
from accelstudy.hidden.cells import planned
from accelstudy.hidden.config import parse_hidden
from accelstudy.jobs.job import job

with job(snakemake) as provenance:
    run_baselines(
        parse_hidden(snakemake.config),
        planned(snakemake.input[0], int(snakemake.wildcards.chunk)),
        snakemake.output[0],
        provenance,
    )
