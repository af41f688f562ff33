from pathlib import Path

from accelstudy.field.config import FieldCase
from accelstudy.jobs.job import logged

with logged(snakemake):
    case = FieldCase.model_validate(snakemake.params.case)
    case.write(Path(snakemake.output[0]).parent, snakemake.params.provenance)
