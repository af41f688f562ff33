from accelstudy.hidden.cells import planned
from accelstudy.hidden.config import parse_hidden
from accelstudy.hidden.diagnosing import run_chunk
from accelstudy.jobs.job import job

with job(snakemake) as provenance:
    run_chunk(
        parse_hidden(snakemake.config),
        planned(snakemake.input[0], int(snakemake.wildcards.chunk)),
        dict(snakemake.output.items()),
        provenance,
    )
