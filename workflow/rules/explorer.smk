from importlib.util import find_spec

# Said before anything is simulated, as the page is made at the end.
if not all(map(find_spec, ("altair", "vl_convert"))):
    raise WorkflowError(
        "the explorer of a study is made with Altair and vl-convert, which are not installed: "
        "pip install 'accelstudy[workflow]'"
    )


rule explorer:
    input:
        **{table: f"{RESULTS}/{table}.parquet" for table in TABLES},
    output:
        report(
            f"{RESULTS}/explorer.html",
            caption="../report/explorer.rst",
            category="Study",
            labels={"content": "Explorer: choose set-ups and see what they give"},
        ),
    log:
        f"{RESULTS}/logs/explorer.log",
    benchmark:
        f"{RESULTS}/benchmarks/explorer.tsv"
    conda:
        "../envs/accelstudy.yaml"
    threads: 1
    resources:
        mem_mb=megabytes(1000),
    params:
        study=DRAWN,
        figures=FIGURES,
        code=code_of("explorer"),
    message:
        "Make the explorer of the study"
    script:
        "../scripts/explorer.py"
