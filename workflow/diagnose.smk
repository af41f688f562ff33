# Simulate a campaign with hidden effects, and diagnose it:
# snakemake --cores 2 --snakefile workflow/diagnose.smk --configfile config/diagnose-example.yaml
from dataclasses import asdict

from snakemake.exceptions import WorkflowError
from snakemake.utils import min_version

from accelstudy.diagnosis.round_trip import parse_round_trip
from accelstudy.basics.errors import InputError
from accelstudy.files.outputs import CAMPAIGN, DIAGNOSIS
from accelstudy.schemes import is_scheme_file
from accelstudy.files.reading import read_layer
from accelstudy.jobs.earlier import earlier_run
from accelstudy.jobs.job import killed_notice, prepare_jobs
from accelstudy.files.outputs import check_writable
from accelstudy.jobs.code import code_hash

min_version("9.10")
prepare_jobs()


# Jobs run in the environment of the Makefile. This is for executors that need a container.
container: "docker://python:3.13-slim"


try:
    if not config:
        raise InputError("no campaign; give it with --configfile config/diagnose-example.yaml")
    for path in workflow.configfiles:
        read_layer(path)  # Snakemake's own reading is less strict
    TRIP = parse_round_trip(config, ", ".join(map(str, workflow.configfiles)) or "config")
    RESULTS = f"results/{TRIP.campaign.name}"
    check_writable(RESULTS)
    # Check earlier results before Snakemake decides what to make. On a cluster, jobs read this
    # file again; they skip the check.
    if workflow.is_main_process:
        made = {f"{RESULTS}/campaign": CAMPAIGN, f"{RESULTS}/diagnosis": DIAGNOSIS}
        for line in earlier_run(RESULTS, [], {}, None, made):
            logger.warning(line)
except InputError as error:
    raise WorkflowError(str(error)) from None


onerror:
    if notice := killed_notice(log):
        logger.error(notice)


rule round_trip:
    default_target: True
    input:
        f"{RESULTS}/diagnosis",


rule simulate_campaign:
    input:
        [TRIP.campaign.scheme] if is_scheme_file(TRIP.campaign.scheme) else [],
    output:
        campaign=directory(f"{RESULTS}/campaign"),
        truth=f"{RESULTS}/truth.yaml",
    log:
        f"{RESULTS}/logs/simulate_campaign.log",
    benchmark:
        f"{RESULTS}/benchmarks/simulate_campaign.tsv"
    threads: 1
    resources:
        mem_mb=2000,
    params:
        settings=asdict(TRIP.campaign),
        code=code_hash(workflow.source_path("scripts/simulate_campaign.py")),
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
    threads: 1
    resources:
        mem_mb=2000,
    params:
        settings={
            "model": TRIP.model,
            "approach": TRIP.approach,
            "seed": TRIP.seed,
            "replicates": TRIP.replicates,
        },
        code=code_hash(workflow.source_path("scripts/diagnose.py")),
    message:
        "Diagnose the campaign"
    script:
        "scripts/diagnose.py"
