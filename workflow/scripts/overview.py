from accelstudy.campaign.batch.config import parse_batch
from accelstudy.campaign.batch.overview import counts, summarise_campaigns
from accelstudy.jobs import script_log

with script_log(snakemake):
    batch = parse_batch(snakemake.config)
    table = summarise_campaigns(
        batch.batch,
        snakemake.input,
        **dict(snakemake.output.items()),
        provenance={"config_hash": batch.fingerprint, "seed": None},
    )
    failed = table[table["status"] == "failed"]
    for row in failed.itertuples():
        print(f"not calibrated: {row.campaign}: {row.error}")
    print(f"{counts(table)}: {snakemake.output.page}")
