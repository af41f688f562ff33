from accelstudy.jobs import job
from studies.hidden.campaigns import parse_hidden, run

with job(snakemake):
    config = parse_hidden(snakemake.config)
    run(config.job(snakemake.wildcards.job), snakemake.output[0])
