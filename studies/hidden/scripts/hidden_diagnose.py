from accelstudy.jobs import job
from studies.hidden.cells import planned
from studies.hidden.config import parse_hidden
from studies.hidden.diagnosing import run_chunk

with job(snakemake) as provenance:
    config = parse_hidden(snakemake.config)
    provenance["config_hash"] = config.fingerprint
    campaigns = planned(snakemake.input[0], int(snakemake.wildcards.chunk))
    run_chunk(config, campaigns, snakemake.output, provenance)
