from accelstudy.hidden.config import parse_hidden
from accelstudy.hidden.page import write_score
from accelstudy.jobs.job import logged

with logged(snakemake):
    page = write_score(
        parse_hidden(snakemake.params.config),
        dict(snakemake.input.items()),
        dict(snakemake.output.items()),
        snakemake.params.provenance,
    )
    print(page, end="")
