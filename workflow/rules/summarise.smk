rule summarise:
    input:
        estimates=f"{RESULTS}/estimates/{{batch}}.parquet",
        correlations=f"{PARTS}/correlations_adjustment.parquet",
    output:
        **{table: f"{PARTS}/{table}.parquet" for table in TABLES},
    log:
        f"{RESULTS}/logs/summarise/{{batch}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/summarise/{{batch}}.tsv"
    threads: 1
    resources:
        mem_mb=4000,
    params:
        spec=batch_spec,
        leveling=STUDY.leveling.model_dump(),
        code=code_hash("summarise"),
    message:
        "Summarise batch {wildcards.batch}"
    script:
        "../scripts/summarise.py"


rule collect:
    input:
        **{table: expand(f"{PARTS}/{table}.parquet", batch=BATCHES) for table in TABLES},
    output:
        **{table: f"{RESULTS}/{table}.parquet" for table in TABLES},
    log:
        f"{RESULTS}/logs/collect.log",
    benchmark:
        f"{RESULTS}/benchmarks/collect.tsv"
    threads: 1
    resources:
        mem_mb=2000,
    params:
        code=code_hash("summarise"),
    message:
        "Collect the tables of all batches"
    script:
        "../scripts/collect.py"
