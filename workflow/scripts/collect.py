from accelstudy.study.job import job
from accelstudy.study.tables import collect

with job(snakemake) as (_, provenance):
    for table, parts in snakemake.input.items():
        collect([parts] if isinstance(parts, str) else parts, snakemake.output[table], provenance)
