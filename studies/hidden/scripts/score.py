from accelstudy.jobs import job, lists
from studies.hidden.campaigns import parse_hidden
from studies.hidden.scoring.page import write_score

with job(snakemake) as provenance:
    config, inputs = parse_hidden(snakemake.config), lists(snakemake.input)
    provenance["config_hash"] = config.fingerprint
    print(write_score(config, inputs, snakemake.output, provenance), end="")
