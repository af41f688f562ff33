from accelstudy.files.tables import write_table
from accelstudy.jobs.job import logged
from accelstudy.sequential.config import SequentialConfig
from accelstudy.sequential.simulation import sessions_table

with logged(snakemake):
    config, provenance = snakemake.params.config, snakemake.params.provenance
    table = sessions_table(
        SequentialConfig(**config), snakemake.wildcards.approach, provenance["seed"]
    )
    write_table(snakemake.output[0], table, provenance)
