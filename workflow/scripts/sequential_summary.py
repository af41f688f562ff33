from accelstudy.drawing.saving import save
from accelstudy.drawing.style import DPI
from accelstudy.files.tables import read_table, write_table
from accelstudy.jobs import job
from accelstudy.sequential.config import SequentialConfig
from accelstudy.sequential.figure import sequential_figure
from accelstudy.sequential.simulation import summary_table

with job(snakemake) as provenance:
    config, out = SequentialConfig(**snakemake.params.config), snakemake.output
    summary = summary_table(config, read_table(list(snakemake.input)))
    write_table(out.table, summary, provenance)
    save(sequential_figure(summary, config.instead_of), out.svg, out.png, "Positions", DPI)
