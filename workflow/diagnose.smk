# Simulate a campaign with hidden effects, and diagnose it:
# snakemake --cores 2 --snakefile workflow/diagnose.smk --configfile config/diagnose-example.yaml
from dataclasses import asdict

from accelstudy.diagnosis.round_trip import parse_round_trip
from accelstudy.files.outputs import CAMPAIGN, DIAGNOSIS
from accelstudy.schemes import is_scheme_file


include: "rules/start.smk"


TRIP, RESULTS = configured(
    parse_round_trip,
    "campaign.name",
    "no campaign; give it with --configfile config/diagnose-example.yaml",
)
look_at_earlier([], folders={f"{RESULTS}/campaign": CAMPAIGN, f"{RESULTS}/diagnosis": DIAGNOSIS})


rule round_trip:
    default_target: True
    input:
        f"{RESULTS}/diagnosis",


rule simulate_campaign:
    input:
        [given(TRIP.campaign.scheme)] if is_scheme_file(TRIP.campaign.scheme) else [],
    output:
        campaign=directory(f"{RESULTS}/campaign"),
        truth=f"{RESULTS}/truth.yaml",
    log:
        f"{RESULTS}/logs/simulate_campaign.log",
    benchmark:
        f"{RESULTS}/benchmarks/simulate_campaign.tsv"
    conda:
        "envs/accelstudy.yaml"
    threads: 1
    resources:
        mem_mb=megabytes(2000),
    params:
        settings=asdict(TRIP.campaign),
        code=code_of("simulate_campaign"),
    message:
        "Simulate the campaign"
    script:
        "scripts/simulate_campaign.py"


rule diagnose:
    input:
        rules.simulate_campaign.output.campaign,
    output:
        directory(f"{RESULTS}/diagnosis"),
    log:
        f"{RESULTS}/logs/diagnose.log",
    benchmark:
        f"{RESULTS}/benchmarks/diagnose.tsv"
    conda:
        "envs/accelstudy.yaml"
    threads: 1
    resources:
        mem_mb=megabytes(2000),
    params:
        settings={
            "model": TRIP.model,
            "approach": TRIP.approach,
            "seed": TRIP.seed,
            "replicates": TRIP.replicates,
        },
        angle_unit=angle_unit(),
        code=code_of("diagnose"),
    message:
        "Diagnose the campaign"
    script:
        "scripts/diagnose.py"
