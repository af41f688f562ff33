from accelstudy.files.tables import write_table
from accelstudy.jobs import job
from accelstudy.sequential.config import SequentialConfig
from accelstudy.sequential.simulation import sessions_table

with job(snakemake) as provenance:
    config = SequentialConfig(**snakemake.params.config)
    table = sessions_table(config, snakemake.wildcards.approach, provenance["seed"])
    write_table(snakemake.output[0], table, provenance)
