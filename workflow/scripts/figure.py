from accelstudy.files.tables import read_table
from accelstudy.jobs import job
from accelstudy.study.config import Study
from accelstudy.study.figures import write_figure

with job(snakemake):
    write_figure(
        snakemake.wildcards.figure,
        {name: read_table(path) for name, path in snakemake.input.items()},
        Study.model_validate(snakemake.config),
        snakemake.output[0],
    )
