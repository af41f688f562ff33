import os

from accelstudy.campaign.batch_config import parse_batch
from accelstudy.campaign.overview import counts, summarise_batch
from accelstudy.study.job import logged
from accelstudy.units import ANGLE_UNIT_VARIABLE, angles_in

with logged(snakemake), angles_in(os.environ.get(ANGLE_UNIT_VARIABLE)):
    batch = parse_batch(snakemake.config)
    table = summarise_batch(
        batch.batch,
        snakemake.input,
        **dict(snakemake.output.items()),
        provenance={"config_hash": batch.fingerprint, "seed": None},
    )
    failed = table[table["status"] == "failed"]
    for row in failed.itertuples():
        print(f"not calibrated: {row.campaign}: {row.error}")
    print(f"{counts(table)}: {snakemake.output.page}")
