from accelstudy.jobs.job import job
from accelstudy.study.config import StudyConfig
from accelstudy.study.explorer.page import write_explorer

with job(snakemake):
    write_explorer(
        StudyConfig.model_validate(snakemake.config),
        dict(snakemake.input.items()),
        snakemake.output[0],
        {name: str(snakemake.report_href(path)) for name, path in snakemake.params.figures.items()},
    )
