from accelstudy.hidden.real_noise import parse_real_noise
from accelstudy.hidden.real_page import write_real_score
from accelstudy.jobs.job import job

with job(snakemake) as provenance:
    page = write_real_score(
        parse_real_noise(snakemake.config),
        [*snakemake.input],
        dict(snakemake.output.items()),
        provenance,
    )
    print(page, end="")
