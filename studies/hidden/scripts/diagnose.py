from accelstudy.jobs import job
from studies.hidden.campaigns import parse_hidden, run

with job(snakemake) as provenance:
    config = parse_hidden(snakemake.config)
    provenance["config_hash"] = config.fingerprint
    run(config.job(snakemake.wildcards.job), snakemake.output[0], provenance)
