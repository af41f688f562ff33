from pathlib import Path

from accelstudy.jobs.job import logged
from accelstudy.pole.config import PoleCase

with logged(snakemake):
    case = PoleCase.model_validate(snakemake.params.case)
    provenance = snakemake.params.provenance
    case.write(provenance["seed"], Path(snakemake.output.summary).parent, provenance)
