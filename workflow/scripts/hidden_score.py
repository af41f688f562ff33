from accelstudy.hidden.config import parse_hidden
from accelstudy.hidden.page import write_score
from accelstudy.jobs.job import job

with job(snakemake) as provenance:
    page = write_score(
        parse_hidden(snakemake.config),
        dict(snakemake.input.items()),
        dict(snakemake.output.items()),
        provenance,
    )
    print(page, end="")
