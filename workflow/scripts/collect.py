from accelstudy.files.tables import collect
from accelstudy.jobs.job import job, lists

with job(snakemake) as provenance:
    for table, parts in lists(snakemake.input).items():
        collect(parts, snakemake.output[table], provenance)
