from accelstudy.files.tables import read_table
from accelstudy.jobs import job
from accelstudy.study.config import Study
from accelstudy.study.explorer.page import write_explorer

with job(snakemake):
    write_explorer(
        Study.model_validate(snakemake.config),
        {name: read_table(path) for name, path in snakemake.input.items()},
        snakemake.output[0],
    )
