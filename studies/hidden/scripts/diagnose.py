from accelstudy.jobs import job
from studies.hidden.campaigns import parse_hidden, run

with job(snakemake):
    run(parse_hidden(snakemake.config), snakemake.wildcards.job, snakemake.output[0])
