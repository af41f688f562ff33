from accelstudy.proposal.config import DesignsConfig

DESIGNS = section(EXAMPLE, "designs", DesignsConfig, SOURCE)
DESIGNS_FILES = {kind: f"{RESULTS}/designs/efficiency.{kind}" for kind in ("parquet", "svg", "png")}
OUTPUTS += DESIGNS_FILES.values()


rule designs:
    output:
        table=DESIGNS_FILES["parquet"],
        svg=DESIGNS_FILES["svg"],
        png=DESIGNS_FILES["png"],
    log:
        f"{RESULTS}/logs/designs/efficiency.log",
    conda:
        "../envs/accelstudy.yaml"
    params:
        # As written, with the paths of files, and as read, with the content of the files.
        section=EXAMPLE.designs,
        read=DESIGNS.model_dump(),
        seed=EXAMPLE.seed,
        version=VERSION,
    message:
        "Compare position schemes with optimal designs"
    script:
        "../scripts/designs.py"
