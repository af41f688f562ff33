from accelstudy.jobs.job import job
from studies.hidden.config import parse_hidden
from studies.hidden.page import write_score

with job(snakemake) as provenance:
    page = write_score(
        parse_hidden(snakemake.config),
        dict(snakemake.input.items()),
        dict(snakemake.output.items()),
        provenance,
    )
    print(page, end="")
