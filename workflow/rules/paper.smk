# It needs a few cells only, and what waits for it takes longer than all else that is left. So it
# starts before the tables of all batches are there.
rule sensitivity:
    input:
        **(
            {
                table: expand(f"{BATCH}/{table}.parquet", batch=batches_of_claims())
                for table in ("summary", "correlations")
            }
            if STUDY.sensitivity
            else {}
        ),
    output:
        sensitivity=f"{RESULTS}/sensitivity.parquet",
        shapley=f"{RESULTS}/shapley.parquet",
    log:
        f"{RESULTS}/logs/sensitivity.log",
    benchmark:
        f"{RESULTS}/benchmarks/sensitivity.tsv"
    priority: 2
    conda:
        "../envs/accelstudy.yaml"
    threads: 1
    resources:
        mem_mb=megabytes(2000),
    params:
        settings=STUDY.sensitivity.model_dump() if STUDY.sensitivity else None,
        sensor=STUDY.model_dump(include={"seed", "gravity_mps2", "noise", "sensor"}),
        code=code_of("sensitivity"),
    message:
        "Analyse the sensitivity of roll and pitch"
    script:
        "../scripts/sensitivity.py"


rule claims:
    input:
        estimates=expand(ESTIMATES, batch=batches_of_claims()) if STUDY.paper else [],
        cells=f"{RESULTS}/cells.parquet",
        summary=f"{RESULTS}/summary.parquet",
        correlations=f"{RESULTS}/correlations.parquet",
        sensitivity=f"{RESULTS}/sensitivity.parquet",
        shapley=f"{RESULTS}/shapley.parquet",
    output:
        claims=f"{RESULTS}/claims.parquet",
        by_scheme=f"{RESULTS}/claims_by_scheme.parquet",
        html=report(
            f"{RESULTS}/claims.html",
            caption="../report/claims.rst",
            category="Claims",
            labels={"content": "All claims with verdicts"},
        ),
    log:
        f"{RESULTS}/logs/claims.log",
    benchmark:
        f"{RESULTS}/benchmarks/claims.tsv"
    conda:
        "../envs/accelstudy.yaml"
    threads: 1
    resources:
        mem_mb=megabytes(1000),
    params:
        code=code_of("claims"),
    message:
        "Judge the paper's claims, and what simulation adds"
    script:
        "../scripts/claims.py"
