from pathlib import Path

from accelstudy.pole.config import PoleCase
from accelstudy.study.job import logged

with logged(snakemake):
    case = PoleCase.model_validate(snakemake.params.case)
    provenance = snakemake.params.provenance
    case.write(provenance["seed"], Path(snakemake.output.summary).parent, provenance)
