from accelstudy.hidden.cells import write_plan
from accelstudy.hidden.config import parse_hidden
from accelstudy.jobs.job import logged

with logged(snakemake):
    write_plan(parse_hidden(snakemake.config), snakemake.output[0])
