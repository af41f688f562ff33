rule figure:
    input:
        unpack(lambda w: {t: f"{RESULTS}/{t}.parquet" for t in get_figure(w.figure).tables}),
    output:
        report(
            f"{RESULTS}/figures/{{figure}}.{{kind}}",
            caption="../report/caption.rst",
            category=lambda wildcards: get_figure(wildcards.figure).category,
            labels=lambda wildcards: {"content": get_figure(wildcards.figure).title},
        ),
    log:
        f"{RESULTS}/logs/figures/{{figure}}.{{kind}}.log",
    priority: 1
    conda:
        "../envs/accelstudy.yaml"
    params:
        caption=lambda wildcards: caption(wildcards.figure, STUDY),
        study=SHOWN,
        angle_unit=UNIT,
        version=VERSION,
    message:
        "Draw {wildcards.figure}.{wildcards.kind}"
    script:
        "../scripts/figure.py"


rule page:
    input:
        **{name: f"{RESULTS}/{name}.parquet" for name in TABLES if name != "correlations"},
    output:
        report(
            f"{RESULTS}/explorer.html",
            caption="../report/explorer.rst",
            category="Study",
            labels={"content": "Explorer: choose set-ups and see what they give"},
        ),
    log:
        f"{RESULTS}/logs/page.log",
    conda:
        "../envs/accelstudy.yaml"
    params:
        study=SHOWN,
        angle_unit=UNIT,
        version=VERSION,
    message:
        "Make the page of all set-ups"
    script:
        "../scripts/page.py"
