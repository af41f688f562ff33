def figure_inputs(wildcards):
    """Tables that a figure needs; of the estimates only the files with the paper's two cells."""
    inputs = {}
    for table in figure_tables(wildcards.figure):
        if table == "estimates":
            inputs[table] = estimates_of(
                lambda cell: (cell.model, cell.scheme)
                == (STUDY.sensitivity.model, STUDY.sensitivity.scheme)
            )
        else:
            inputs[table] = f"{RESULTS}/{table}.parquet"
    return inputs


rule figure:
    input:
        unpack(figure_inputs),
    output:
        svg=report(
            RESULTS + "/figures/{figure}.svg",
            caption="../report/figures/{figure}.rst",
            category=lambda wildcards: get_figure(wildcards.figure).category,
            labels=lambda wildcards: {"content": get_figure(wildcards.figure).title},
        ),
        png=RESULTS + "/figures/{figure}.png",
    log:
        RESULTS + "/logs/figures/{figure}.log",
    benchmark:
        RESULTS + "/benchmarks/figures/{figure}.tsv"
    threads: 1
    resources:
        mem_mb=2000,
    params:
        study=STUDY.model_dump(mode="json"),
        code=code_hash("figures"),
    message:
        "Draw {wildcards.figure}"
    script:
        "../scripts/figure.py"
