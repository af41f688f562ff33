from accelstudy.jobs import logged
from studies.hidden.campaigns import parse_hidden

with logged(snakemake):
    parse_hidden(snakemake.config).write_plan(snakemake.output[0])
