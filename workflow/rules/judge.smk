# What is judged by the cells of one model.
JUDGED = [
    name
    for name, cells in SET_UPS.items()
    if STUDY.sensitivity and any(cell.model == STUDY.sensitivity.model.name for cell in cells)
]


# Much waits for it, and it needs a few cells only. So it starts before all tables are there.
rule sensitivity:
    input:
        summary=expand(f"{RESULTS}/tables/{{set_up}}/summary.parquet", set_up=JUDGED),
        correlations=expand(f"{RESULTS}/tables/{{set_up}}/correlations.parquet", set_up=JUDGED),
    output:
        sensitivity=f"{RESULTS}/sensitivity.parquet",
        shapley=f"{RESULTS}/shapley.parquet",
    log:
        f"{RESULTS}/logs/sensitivity.log",
    priority: 2
    conda:
        "../envs/accelstudy.yaml"
    params:
        settings=STUDY.sensitivity.model_dump() if STUDY.sensitivity else None,
        sensor=STUDY.model_dump(include={"gravity_mps2", "noise", "sensor"}),
        seed=STUDY.seed,
        version=NUMBERS,
    message:
        "Analyse the sensitivity of roll and pitch"
    script:
        "../scripts/sensitivity.py"


rule claims:
    input:
        cells=f"{RESULTS}/cells.parquet",
        summary=f"{RESULTS}/summary.parquet",
        correlations=f"{RESULTS}/correlations.parquet",
        sensitivity=f"{RESULTS}/sensitivity.parquet",
        shapley=f"{RESULTS}/shapley.parquet",
    output:
        claims=f"{RESULTS}/claims.parquet",
        html=report(
            f"{RESULTS}/claims.html",
            caption="../report/claims.rst",
            category="Claims",
            labels={"content": "All claims with verdicts"},
        ),
    log:
        f"{RESULTS}/logs/claims.log",
    conda:
        "../envs/accelstudy.yaml"
    params:
        version=VERSION,
    message:
        "Judge the paper's claims"
    script:
        "../scripts/claims.py"
