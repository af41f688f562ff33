from accelstudy.jobs import job
from studies.hidden.real_noise import parse_real_noise, run_log

with job(snakemake) as provenance:
    config, log = parse_real_noise(snakemake.config), snakemake.wildcards.log
    provenance["config_hash"] = config.fingerprint
    run_log(config, log, snakemake.output[0], provenance)
