from accelstudy.jobs import job
from studies.hidden.cells import planned
from studies.hidden.config import parse_hidden
from studies.hidden.diagnosing import run_chunk

with job(snakemake) as provenance:
    campaigns = planned(snakemake.input[0], int(snakemake.wildcards.chunk))
    run_chunk(parse_hidden(snakemake.config), campaigns, snakemake.output, provenance)
