from accelstudy.files.tables import write_table
from accelstudy.jobs import job
from accelstudy.study.tables import collect

with job(snakemake) as provenance:
    for name, parts in snakemake.input.items():
        write_table(snakemake.output[name], collect(parts, snakemake.params.cells), provenance)
