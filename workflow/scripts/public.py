from accelstudy.campaign.importing.public import record_public
from accelstudy.jobs import logged

with logged(snakemake):
    record_public(
        snakemake.wildcards.public,
        snakemake.params.folder,
        snakemake.output[0],
        snakemake.params.attempt,
    )
