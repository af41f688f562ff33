from accelstudy.study.job import job, lists
from accelstudy.study.tables import collect

with job(snakemake) as provenance:
    for table, parts in lists(snakemake.input).items():
        collect(parts, snakemake.output[table], provenance)
