rule figure:
    input:
        unpack(figure_inputs),
    output:
        svg=report(
            f"{RESULTS}/figures/{{figure}}.svg",
            caption="../report/figure.rst",
            category=lambda wildcards: get_figure(wildcards.figure).category,
            labels=lambda wildcards: {"content": get_figure(wildcards.figure).title},
        ),
        png=f"{RESULTS}/figures/{{figure}}.png",
    log:
        f"{RESULTS}/logs/figures/{{figure}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/figures/{{figure}}.tsv"
    threads: 1
    resources:
        mem_mb=1000,
    params:
        study=STUDY.model_dump(mode="json"),
        caption=figure_caption,
        code=code_hash("figures"),
    message:
        "Draw {wildcards.figure}"
    script:
        "../scripts/figure.py"
