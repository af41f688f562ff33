from accelstudy.jobs.job import job
from studies.hidden.real_noise import parse_real_noise
from studies.hidden.real_page import write_real_score

with job(snakemake) as provenance:
    page = write_real_score(
        parse_real_noise(snakemake.config),
        [*snakemake.input],
        dict(snakemake.output.items()),
        provenance,
    )
    print(page, end="")
