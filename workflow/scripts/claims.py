from accelstudy.files.outputs import whole_file
from accelstudy.files.tables import read_table, write_table
from accelstudy.jobs import job
from accelstudy.study.claims.page import claims_page
from accelstudy.study.claims.verdicts import ClaimData, judge
from accelstudy.study.config import Study

with job(snakemake) as provenance, whole_file(snakemake.output.html) as path:
    tables = {name: read_table(table) for name, table in snakemake.input.items()}
    claims = judge(ClaimData(Study.model_validate(snakemake.config), tables))
    write_table(snakemake.output.claims, claims, provenance)
    path.write_text(claims_page(claims), encoding="utf-8")
