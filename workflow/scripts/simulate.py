from accelstudy.jobs import job
from accelstudy.study.results import simulate_cells

with job(snakemake) as provenance:
    cells, leveling = snakemake.params.cells, snakemake.params.leveling
    simulate_cells(cells, leveling, dict(snakemake.output.items()), provenance)
