from pathlib import Path

from accelstudy.jobs.job import job
from accelstudy.pole.config import PoleCase

with job(snakemake) as provenance:
    case = PoleCase.model_validate(snakemake.params.case)
    case.write(provenance["seed"], Path(snakemake.output.summary).parent, provenance)
