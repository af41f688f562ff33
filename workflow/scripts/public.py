from accelstudy.campaign.importing.public import public_file
from accelstudy.jobs import logged

with logged(snakemake):
    public_file(snakemake.wildcards.public, snakemake.params.folder)
