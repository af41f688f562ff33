"""Run the smoke study by profiles/slurm and on this machine alone; the tables must be the same.

`make test-cluster` runs it. It needs no SLURM: a few commands stand in for those of one, and what
they get submitted is a process of this machine.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
from places import ROOT

STUDY = [
    *(sys.executable, "-m", "snakemake", "--snakefile", ROOT / "Snakefile"),
    *("--workflow-profile", ROOT / "profiles" / "default"),
    *("--configfile", ROOT / "config" / "config.yaml", ROOT / "config" / "smoke.yaml"),
]
# It needs all the others.
ALL_TABLES = "results/smoke/claims.parquet"
# What the profile cannot know: there are no accounts, the cores are few, and jobs are short. With
# one job in a submission, several of them run at once.
BY_SLURM = [
    *("--profile", ROOT / "profiles" / "slurm", "--slurm-no-account", "--jobs", "2"),
    *("--slurm-init-seconds-before-status-checks", "3", "--group-components"),
    *("simulate=1", "results=100000", "--cores", str(min(2, os.cpu_count() or 1))),
]
STAND_INS = {
    "sbatch": r"""
        while [ $# -gt 0 ]; do
          case $1 in --output) log=$2 ;; --wrap=*) job=${1#--wrap=} ;; esac
          shift
        done
        log=$(printf %s "$log" | sed "s/%j/$$/")
        export SLURM_JOB_ID=$$
        echo RUNNING >"$QUEUE/$$"
        { sh -c "$job" && end=COMPLETED || end=FAILED; echo $end >"$QUEUE/$$"; } >"$log" 2>&1 &
        echo $$
    """,
    "sacct": """cd "$QUEUE" && grep -H . * | tr : '|'""",
    "sinfo": "echo all*",
    "srun": """while [ "${1#-}" != "$1" ]; do shift; done; exec "$@" """,
}
"""The commands that the profile's executor calls: a job has the number of its `sbatch`, and a file
of this name in $QUEUE has its state."""


def main() -> None:
    """Exit with 0 if all is the same, and with 1 if not."""
    folder = Path(tempfile.mkdtemp(prefix="accelstudy-slurm-"))
    try:
        run([*STUDY, *BY_SLURM], folder / "by-slurm", with_stand_ins(folder / "slurm"))
        alone = [*STUDY, "--cores", str(os.cpu_count()), "--", ALL_TABLES]
        run(alone, folder / "alone", dict(os.environ))
        different = differences(folder / "by-slurm", folder / "alone")
    except BaseException:
        print(f"what was run, and the logs, stay in {folder}", file=sys.stderr)
        raise
    if different:
        sys.exit(f"not the same by SLURM and without, in {folder}: {', '.join(different)}")
    submissions = len(list((folder / "slurm" / "queue").iterdir()))
    tables = len(list((folder / "alone").rglob("*.parquet")))
    print(f"{tables} tables are the same by SLURM, in {submissions} submissions, and without")
    shutil.rmtree(folder)


def with_stand_ins(folder: Path) -> dict[str, str]:
    """Environment in which the commands of SLURM are the stand-ins, written to a new folder."""
    (folder / "queue").mkdir(parents=True)
    for name, script in STAND_INS.items():
        (folder / name).write_text(f"#!/bin/sh\n{script}\n", encoding="utf-8")
        (folder / name).chmod(0o755)
    path = f"{folder}:{os.environ['PATH']}"
    return {**os.environ, "PATH": path, "QUEUE": str(folder / "queue")}


def run(command: list[str | Path], folder: Path, environment: dict[str, str]) -> None:
    """Run a study in a new folder; the process ends with one line if it fails."""
    folder.mkdir()
    if subprocess.run(command, cwd=folder, env=environment, check=False).returncode:
        sys.exit(f"failed: {' '.join(map(str, command))}")


def differences(one: Path, other: Path) -> list[str]:
    """Tables that only one of the folders has, or whose rows are not those of the other.

    Numbers are compared bit by bit.
    """
    names = {path.relative_to(each) for each in (one, other) for path in each.rglob("*.parquet")}
    if not names:
        return ["no tables"]
    return [str(name) for name in sorted(names) if bits(one / name) != bits(other / name)]


def bits(path: Path) -> bytes | None:
    """The rows of a table as bytes, however it is cut and compressed; None if absent."""
    if not path.is_file():
        return None
    table = pq.read_table(path, partitioning=None).combine_chunks().replace_schema_metadata()
    sink = pa.BufferOutputStream()
    with pa.ipc.new_stream(sink, table.schema) as stream:
        stream.write_table(table)
    return sink.getvalue().to_pybytes()


if __name__ == "__main__":
    main()
