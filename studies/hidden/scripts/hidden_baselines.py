from accelstudy.jobs import job
from studies.hidden.baselines import run_baselines
from studies.hidden.cells import planned
from studies.hidden.config import parse_hidden

with job(snakemake) as provenance:
    config = parse_hidden(snakemake.config)
    provenance["config_hash"] = config.fingerprint
    campaigns = planned(snakemake.input[0], int(snakemake.wildcards.chunk))
    run_baselines(config, campaigns, snakemake.output[0], provenance)
