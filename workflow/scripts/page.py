from pathlib import Path

from accelstudy.files.tables import read_table
from accelstudy.jobs import job
from accelstudy.study.config import Study
from accelstudy.study.explorer.page import write_explorer

with job(snakemake):
    figures = Path(snakemake.output[0]).parent / "figures"
    paths = {name: figures / f"{name}.svg" for name in snakemake.params.figures}
    write_explorer(
        Study.model_validate(snakemake.config),
        {name: read_table(path) for name, path in snakemake.input.items()},
        snakemake.output[0],
        {name: str(snakemake.report_href(path)) for name, path in paths.items()},
    )
