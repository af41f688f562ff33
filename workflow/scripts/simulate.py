from accelstudy.jobs import job
from accelstudy.study.results import simulate_cells

with job(snakemake) as provenance:
    simulate_cells(snakemake.params.cells, dict(snakemake.output.items()), provenance)
