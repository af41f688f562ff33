from accelstudy.files.outputs import whole_file
from accelstudy.files.tables import read_table
from accelstudy.jobs import job
from accelstudy.study.config import Study
from accelstudy.study.explorer.page import explorer_page

with job(snakemake), whole_file(snakemake.output[0]) as path:
    tables = {name: read_table(table) for name, table in snakemake.input.items()}
    page = explorer_page(Study.model_validate(snakemake.config), tables)
    path.write_text(page, encoding="utf-8")
