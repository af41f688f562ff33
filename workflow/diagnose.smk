# Simulate a campaign with hidden effects, and diagnose it:
# snakemake --cores 2 --snakefile workflow/diagnose.smk --configfile config/diagnose-example.yaml
from dataclasses import asdict

from accelstudy.diagnosis.round_trip import parse_round_trip
from accelstudy.schemes import is_scheme_file


include: "rules/start.smk"


TRIP, RESULTS = configured(
    parse_round_trip,
    "campaign.name",
    "no campaign; give it with --configfile config/diagnose-example.yaml",
)
VERSION = code_version()


rule round_trip:
    default_target: True
    input:
        f"{RESULTS}/diagnosis",
    message:
        f"The diagnosis of {TRIP.campaign.name}"


rule simulate_campaign:
    input:
        [local(TRIP.campaign.scheme)] if is_scheme_file(TRIP.campaign.scheme) else [],
    output:
        campaign=directory(f"{RESULTS}/campaign"),
        truth=f"{RESULTS}/truth.yaml",
    log:
        f"{RESULTS}/logs/simulate_campaign.log",
    conda:
        "envs/accelstudy.yaml"
    params:
        settings=asdict(TRIP.campaign),
        version=VERSION,
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
    conda:
        "envs/accelstudy.yaml"
    params:
        settings={
            "model": TRIP.model,
            "approach": TRIP.approach,
            "seed": TRIP.seed,
        },
        angle_unit=angle_unit(),
        version=VERSION,
    message:
        "Diagnose the campaign"
    script:
        "scripts/diagnose.py"
