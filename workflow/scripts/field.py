from pathlib import Path

from accelstudy.field.config import FieldCase
from accelstudy.jobs.job import job

with job(snakemake) as provenance:
    case = FieldCase.model_validate(snakemake.params.case)
    case.write(Path(snakemake.output[0]).parent, provenance)
