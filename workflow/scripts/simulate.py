from accelstudy.jobs import job
from accelstudy.study.tables import simulate_cells

with job(snakemake) as provenance:
    simulate_cells(snakemake.params.cells, dict(snakemake.output.items()), provenance)
