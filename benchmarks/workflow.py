"""What a study costs as jobs: calibrations per second of a core, and Snakemake's own part.

    python benchmarks/workflow.py rates
    python benchmarks/workflow.py cells 100 1000 5000

`rates` runs a study of one large cell by gravity and one with a robot (9 parameters, 24 positions)
and one of two small cells, through Snakemake, on one core. The difference is what calibrations
cost, with everything from drawing to the tables; the small one is what starting the jobs costs.

`cells` runs studies of so many cells with 2 replicates each: what Snakemake takes before the first
job (a dry run) and in a whole run, and what its jobs take. 5000 cells take ten minutes.

All are CPU times. Other work on the machine changes them least.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import yaml

ROOT = Path(__file__).parents[1]
MODEL = "bias-scale-nonorthogonality"
MANY, FEW = 500_000, 100

# Snakemake in a process that says what it took itself (all its threads), and what its jobs took.
MEASURED = """\
import json, resource, sys
from snakemake.cli import main
try:
    main(sys.argv[2:])
finally:
    took = [resource.getrusage(w) for w in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    with open(sys.argv[1], "w") as file:
        json.dump([each.ru_utime + each.ru_stime for each in took], file)
"""


def study(name: str, **grid: object) -> dict[str, object]:
    """Configuration of a study of one grid, without what does not grow with it."""
    return {
        "study": name,
        "paper": False,
        "sensitivity": None,
        "leveling": {"attitudes": 50},
        "grids": [{"models": [MODEL], "approaches": ["gravity"], **grid}],
    }


def run(folder: Path, config: dict[str, object], *arguments: str) -> tuple[float, float]:
    """CPU seconds of Snakemake itself and of its jobs, for the tables of a study."""
    name = str(config["study"])
    path, told = folder / f"{name}.yaml", folder / f"{name}.json"
    path.write_text(yaml.safe_dump(config))
    command = [
        *(sys.executable, "-c", MEASURED, told, "--cores", "1", *arguments),
        *("--snakefile", ROOT / "Snakefile", "--workflow-profile", ROOT / "profiles" / "default"),
        *(f"results/{name}/{table}.parquet" for table in ("cells", "summary", "leveling")),
        *("--configfile", ROOT / "config" / "config.yaml", path),
    ]
    variables = {each: "1" for each in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS")}
    ran = subprocess.run(
        list(map(str, command)), cwd=folder, check=False, env={**os.environ, **variables},
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
    )  # fmt: skip
    if ran.returncode:
        sys.exit(ran.stdout)
    own, jobs = json.loads(told.read_text())
    return own, jobs


def rates(folder: Path) -> None:
    """Print calibrations per second of a core."""
    schemes = ["mclaren-24"]
    print("| approach | calibrations a second, a core | starting the jobs | bytes on disk |")
    print("|---|---|---|---|")
    for approach in ("gravity", "robot"):
        took, size = {}, {}
        for count in (FEW, MANY):
            config = study(
                f"{approach}-{count}", schemes=schemes, approaches=[approach], replicates=count
            )
            took[count] = run(folder, config)[1]
            results = folder / "results" / str(config["study"])
            size[count] = sum(p.stat().st_size for p in results.rglob("*.parquet"))
        rate = (MANY - FEW) / (took[MANY] - took[FEW])
        each = (size[MANY] - size[FEW]) / (MANY - FEW)
        print(f"| {approach} | {rate:.3g} | {took[FEW]:.1f} s | {each:.0f} |", flush=True)


def cells(folder: Path, counts: list[int]) -> None:
    """Print what Snakemake and the jobs of studies of so many cells take."""
    print("| cells | before the first job | Snakemake itself | its jobs | Snakemake's part |")
    print("|---|---|---|---|---|")
    schemes = ["mclaren-24", "fibonacci-24", "random-24", "fibonacci-36", "random-36"]
    for count in counts:
        levels = [1e-3 + 1e-6 * i for i in range(count // len(schemes))]
        config = study(f"cells-{count}", schemes=schemes, sensor_sigma_mps2=levels, replicates=2)
        before, _ = run(folder, config, "--dry-run")
        own, jobs = run(folder, config)
        part = own / (own + jobs)
        print(f"| {count} | {before:.1f} s | {own:.1f} s | {jobs:.1f} s | {part:.0%} |", flush=True)


def main() -> None:
    """Run what the command line asks for, in a folder that is removed afterwards."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    kinds = parser.add_subparsers(dest="what", required=True)
    kinds.add_parser("rates")
    kinds.add_parser("cells").add_argument("counts", type=int, nargs="+")
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        if chosen.what == "rates":
            rates(Path(folder))
        else:
            cells(Path(folder), chosen.counts)


if __name__ == "__main__":
    main()
