from accelstudy.campaign.simulated import CampaignSettings
from accelstudy.diagnosis.round_trip import write_simulated
from accelstudy.jobs import script_log

with script_log(snakemake):
    write_simulated(
        CampaignSettings(**snakemake.params.settings),
        snakemake.output.campaign,
        snakemake.output.truth,
    )
