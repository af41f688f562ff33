from accelstudy.campaign.batch.config import parse_batch
from accelstudy.jobs import script_log
from accelstudy.lots.output import run_lot

with script_log(snakemake):
    batch = parse_batch(snakemake.config)
    lot = run_lot(batch, snakemake.input, snakemake.output[0], snakemake.threads)
    print(f"{lot.verdict} {snakemake.output[0]}/report.html")
