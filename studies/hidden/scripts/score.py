from accelstudy.jobs import job
from studies.hidden.campaigns import parse_hidden
from studies.hidden.scoring.page import write_score

with job(snakemake) as provenance:
    config = parse_hidden(snakemake.config)
    provenance["config_hash"] = config.fingerprint
    print(write_score(config, snakemake.input, snakemake.output, provenance), end="")
