from accelstudy.hidden.run import run_baselines
from accelstudy.study.job import logged

with logged(snakemake):
    run_baselines(snakemake.params.spec, snakemake.output[0], snakemake.params.provenance)
