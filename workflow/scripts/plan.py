from pathlib import Path

from accelstudy.jobs import job
from accelstudy.planning.output import make_plan

with job(snakemake) as provenance:
    make_plan(
        snakemake.wildcards.plan,
        snakemake.params.case,
        snakemake.params.replicates,
        Path(snakemake.output[0]).parent,
        provenance,
    )
