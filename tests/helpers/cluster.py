"""Run the smoke study by profiles/slurm and on this machine alone; the tables must be the same.

`make test-cluster` runs it. SLURM is one of its own, on the loopback address, and ends with it.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
from one_machine_slurm import NoSlurmError, one_machine_slurm

ROOT = Path(__file__).parents[2]
STUDY = [
    *(sys.executable, "-m", "snakemake", "--snakefile", ROOT / "Snakefile"),
    *("--workflow-profile", ROOT / "profiles" / "default"),
    *("--configfile", ROOT / "config" / "config.yaml", ROOT / "config" / "smoke.yaml"),
]
# It needs all the others.
ALL_TABLES = "results/smoke/claims.parquet"
# What the profile cannot know of this SLURM: it has no accounts, and jobs are short. With one job
# in a submission, several of them run at once.
BY_SLURM = [
    *("--profile", ROOT / "profiles" / "slurm", "--slurm-no-account"),
    *("--slurm-status-command", "squeue", "--slurm-init-seconds-before-status-checks", "3"),
    *("--slurm-keep-successful-logs", "--group-components"),
    *("simulate=1", "results=100000"),
    *("--cores", str(min(2, os.cpu_count() or 1))),
]


def main() -> None:
    """Exit with 0 if all is the same, with 1 if not, and with 2 without SLURM."""
    # Sockets lie in it, and the path of one is at most 107 characters long.
    folder = Path(tempfile.mkdtemp(prefix="accelstudy-slurm-", dir="/tmp"))
    for name in ("slurm", "by-slurm", "alone"):
        (folder / name).mkdir()
    try:
        with one_machine_slurm(folder / "slurm") as environment:
            run([*STUDY, *BY_SLURM], folder / "by-slurm", environment)
        alone = [*STUDY, "--cores", str(os.cpu_count()), "--", ALL_TABLES]
        run(alone, folder / "alone", dict(os.environ))
        different = differences(folder / "by-slurm", folder / "alone")
    except NoSlurmError as error:
        shutil.rmtree(folder)
        print(error, file=sys.stderr)
        raise SystemExit(2) from None
    except BaseException:
        print(f"what was run, and the logs, stay in {folder}", file=sys.stderr)
        raise
    if different:
        sys.exit(
            "not the same by SLURM and without, in {}: {}".format(folder, ", ".join(different))
        )
    submissions = len(list((folder / "by-slurm").glob(".snakemake/slurm_logs/**/*.log")))
    tables = len(list((folder / "alone").rglob("*.parquet")))
    print(f"{tables} tables are the same by SLURM, in {submissions} submissions, and without")
    shutil.rmtree(folder)


def run(command: list[str | Path], folder: Path, environment: dict[str, str]) -> None:
    """Run a study in a folder; the process ends with one line if it fails."""
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
