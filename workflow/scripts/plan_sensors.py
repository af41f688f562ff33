from accelstudy.plan.tables import sensor_table
from accelstudy.study.job import logged
from accelstudy.study.tables import write_table

with logged(snakemake):
    table = sensor_table(snakemake.params.sensors, snakemake.params.seconds)
    write_table(snakemake.output[0], table, snakemake.params.provenance)
