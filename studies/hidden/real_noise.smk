# Put known effects into the readings of public logs, diagnose them, and score the diagnoses:
# snakemake --cores 2 --snakefile studies/hidden/real_noise.smk
configfile: "studies/hidden/config/real-noise.yaml"


include: "rules.smk"


rule real_noise:
    default_target: True
    input:
        rules.hidden_score.output.page,
