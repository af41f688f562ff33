from accelstudy.campaign.batch.config import parse_batch
from accelstudy.jobs import logged
from accelstudy.lots.run import run_lot

with logged(snakemake):
    batch = parse_batch(snakemake.config)
    content = run_lot(batch, snakemake.input, snakemake.output[0], snakemake.threads)
    print(f"{content['verdict']} {snakemake.output[0]}/report.html")
