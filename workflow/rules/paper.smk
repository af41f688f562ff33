rule sensitivity_analysis:
    input:
        lambda wildcards: [] if wildcards.analysis == "forces" else RESULTS + "/summary.parquet",
    output:
        RESULTS + "/sensitivity/{analysis}.parquet",
    log:
        RESULTS + "/logs/sensitivity/{analysis}.log",
    benchmark:
        RESULTS + "/benchmarks/sensitivity/{analysis}.tsv"
    threads: 1
    resources:
        mem_mb=2000,
    params:
        settings=STUDY.sensitivity.model_dump() if STUDY.sensitivity else None,
        sensor=STUDY.model_dump(include={"seed", "gravity_mps2", "noise", "sensor"}),
        code=code_hash("sensitivity"),
    message:
        "Sensitivity of leveling: {wildcards.analysis}"
    script:
        "../scripts/sensitivity.py"


rule sensitivity:
    input:
        sensitivity=expand(RESULTS + "/sensitivity/{analysis}.parquet", analysis=ANALYSES),
    output:
        sensitivity=RESULTS + "/sensitivity.parquet",
    log:
        RESULTS + "/logs/sensitivity.log",
    benchmark:
        RESULTS + "/benchmarks/sensitivity.tsv"
    threads: 1
    resources:
        mem_mb=2000,
    message:
        "Collect the table of sensitivity"
    script:
        "../scripts/collect.py"


rule claims:
    input:
        estimates=(
            estimates_of(lambda cell: cell.model == STUDY.sensitivity.model) if STUDY.paper else []
        ),
        correlations=RESULTS + "/correlations.parquet",
        sensitivity=RESULTS + "/sensitivity.parquet",
    output:
        claims=RESULTS + "/claims.parquet",
        by_scheme=RESULTS + "/claims_by_scheme.parquet",
        html=report(
            RESULTS + "/claims.html",
            caption="../report/claims.rst",
            category="1 Claims of the paper",
            labels={"content": "All claims with verdicts"},
        ),
    log:
        RESULTS + "/logs/claims.log",
    benchmark:
        RESULTS + "/benchmarks/claims.tsv"
    threads: 1
    resources:
        mem_mb=4000,
    params:
        code=code_hash("claims"),
    message:
        "Judge the paper's claims"
    script:
        "../scripts/claims.py"
