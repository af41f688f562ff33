from accelstudy.hidden.study.cells import write_plan
from accelstudy.hidden.study.config import parse_hidden
from accelstudy.jobs.job import logged

with logged(snakemake):
    write_plan(parse_hidden(snakemake.config), snakemake.output[0])
