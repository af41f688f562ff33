from accelstudy.campaign.importing.public import public_file
from accelstudy.jobs import script_log

with script_log(snakemake):
    public_file(snakemake.wildcards.public, snakemake.params.folder)
