from accelstudy.sequential.config import SequentialConfig

SEQUENTIAL = section(EXAMPLE, "sequential", SequentialConfig, SOURCE)
OUTPUTS += [
    f"{RESULTS}/sequential/{name}" for name in ("summary.parquet", "positions.svg", "positions.png")
]


rule sequential_sessions:
    output:
        f"{RESULTS}/sequential/sessions/{{approach}}.parquet",
    log:
        f"{RESULTS}/logs/sequential/{{approach}}.log",
    wildcard_constraints:
        approach="|".join(SEQUENTIAL.approaches),
    conda:
        "../envs/accelstudy.yaml"
    params:
        config=SEQUENTIAL.model_dump(mode="json"),
        seed=EXAMPLE.seed,
        version=VERSION,
    message:
        "Simulate sessions that choose their positions: {wildcards.approach}"
    script:
        "../scripts/sequential_sessions.py"


rule sequential:
    input:
        expand(
            f"{RESULTS}/sequential/sessions/{{approach}}.parquet", approach=SEQUENTIAL.approaches
        ),
    output:
        table=f"{RESULTS}/sequential/summary.parquet",
        svg=f"{RESULTS}/sequential/positions.svg",
        png=f"{RESULTS}/sequential/positions.png",
    log:
        f"{RESULTS}/logs/sequential/summary.log",
    conda:
        "../envs/accelstudy.yaml"
    params:
        config=SEQUENTIAL.model_dump(mode="json"),
        seed=EXAMPLE.seed,
        version=VERSION,
    message:
        "Summarise how many positions the promised accuracy takes, and how often it is reached"
    script:
        "../scripts/sequential_summary.py"
