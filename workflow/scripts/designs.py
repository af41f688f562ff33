from accelstudy.drawing.saving import save
from accelstudy.drawing.style import DPI
from accelstudy.files.tables import write_table
from accelstudy.jobs import job
from accelstudy.proposal.config import DesignsConfig
from accelstudy.proposal.efficiency import efficiency_table
from accelstudy.proposal.figure import efficiency_figure
from accelstudy.schemes import get_scheme

with job(snakemake) as provenance:
    config = DesignsConfig.model_validate(snakemake.params.section)
    table = efficiency_table(
        [config.task(approach) for approach in config.chosen_approaches],
        [get_scheme(name) for name in config.chosen_schemes],
        config.positions,
        provenance["seed"],
    )
    write_table(snakemake.output.table, table, provenance)
    title = "Efficiency of position schemes"
    save(efficiency_figure(table), snakemake.output.svg, snakemake.output.png, title, DPI)
