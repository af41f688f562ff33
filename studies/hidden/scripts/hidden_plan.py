from accelstudy.jobs import logged
from studies.hidden.cells import write_plan
from studies.hidden.config import parse_hidden

with logged(snakemake):
    write_plan(parse_hidden(snakemake.config), snakemake.output[0])
