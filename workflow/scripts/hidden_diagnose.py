from accelstudy.hidden.run import run_chunk
from accelstudy.study.job import logged

with logged(snakemake):
    run_chunk(snakemake.params.spec, dict(snakemake.output.items()), snakemake.params.provenance)
