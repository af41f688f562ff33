from accelstudy.jobs import job
from studies.hidden.real_noise import parse_real_noise
from studies.hidden.scoring.logs import write_real_score

with job(snakemake) as provenance:
    config = parse_real_noise(snakemake.config)
    provenance["config_hash"] = config.fingerprint
    print(write_real_score(config, snakemake.input, snakemake.output, provenance), end="")
