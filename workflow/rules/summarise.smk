rule summarise:
    input:
        unpack(parts_of_batch),
    output:
        **{name: f"{BATCH}/{name}.parquet" for name in (*TABLES, "sketches")},
    log:
        f"{RESULTS}/logs/summarise/{{batch}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/summarise/{{batch}}.tsv"
    conda:
        "../envs/accelstudy.yaml"
    threads: 1
    resources:
        mem_mb=megabytes(MEMORY),
    params:
        spec=lambda wildcards: {
            "cells": [cell.to_dict() for cell in BATCHES[wildcards.batch].cells]
        },
        setups=lambda wildcards: [setup_of(part) for part in PARTS_OF[wildcards.batch]],
        leveling=STUDY.leveling.model_dump(),
        code=code_of("summarise"),
    message:
        "Work out sds, correlations and tilt errors of batch {wildcards.batch}"
    script:
        "../scripts/summarise.py"


rule collect:
    input:
        **{table: expand(f"{BATCH}/{table}.parquet", batch=BATCHES) for table in COLLECTED},
    output:
        **{table: f"{RESULTS}/{table}.parquet" for table in COLLECTED},
    log:
        f"{RESULTS}/logs/collect.log",
    benchmark:
        f"{RESULTS}/benchmarks/collect.tsv"
    conda:
        "../envs/accelstudy.yaml"
    threads: 1
    resources:
        mem_mb=megabytes(1000),
    params:
        code=code_of("collect"),
    message:
        "Join the tables of all batches"
    script:
        "../scripts/collect.py"
