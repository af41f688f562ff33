rule simulate:
    output:
        **WRITTEN,
    log:
        f"{RESULTS}/logs/simulate/{{part}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/simulate/{{part}}.tsv"
    conda:
        "../envs/accelstudy.yaml"
    threads: 1
    resources:
        mem_mb=megabytes(MEMORY),
    params:
        spec=lambda wildcards: part_spec(wildcards.part),
        code=code_of("simulate"),
    message:
        "Simulate and calibrate batch {wildcards.part}"
    script:
        "../scripts/simulate.py"


rule rare:
    output:
        f"{BATCH}/rare.parquet",
    log:
        f"{RESULTS}/logs/rare/{{batch}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/rare/{{batch}}.tsv"
    conda:
        "../envs/accelstudy.yaml"
    threads: 1
    resources:
        mem_mb=megabytes(MEMORY),
    params:
        spec=lambda wildcards: {
            "seed": STUDY.seed,
            "cells": [RARE_CELLS[cell.name].to_dict() for cell in BATCHES[wildcards.batch].cells],
            "leveling": STUDY.leveling.model_dump(),
            "shares": STUDY.rare.shares,
        },
        code=code_of("rare"),
    message:
        "Simulate rare tilt errors of batch {wildcards.batch}"
    script:
        "../scripts/rare.py"
