from functools import cache
from pathlib import Path

from snakemake.sourcecache import LocalSourceFile

from accelstudy.study.figures import captions, figure_names, figure_tables, get_figure
from accelstudy.study.batches import batches
from accelstudy.study.cells import rare_cells, study_cells
from accelstudy.study.config import parse_study
from accelstudy.study.effort import study_effort
from accelstudy.jobs.job import setup_digest
from accelstudy.study.tables import TABLES

STUDY, RESULTS = configured(parse_study, "study")
STUDY = STUDY.model_copy(update={"angle_unit": STUDY.angle_unit or angle_unit()})
with in_a_line():
    CELLS = study_cells(STUDY)
    EFFORT = study_effort(STUDY, CELLS)
RARE_CELLS = {cell.name: cell for cell in rare_cells(STUDY, CELLS)}

# Jobs get the checked configuration, with all defaults.
config.update(STUDY.model_dump(mode="json"))

# A job simulates a batch of cells, because starting Python takes longer than a small cell. One
# large cell is a batch by itself; several jobs simulate a part of it each.
BATCHES = {f"{i:04d}": batch for i, batch in enumerate(batches(CELLS))}
PARTS_OF = {
    name: [name] if len(batch.jobs) == 1 else [f"{name}-{i:04d}" for i in range(len(batch.jobs))]
    for name, batch in BATCHES.items()
}
PARTS = {
    part: shares
    for name, batch in BATCHES.items()
    for part, shares in zip(PARTS_OF[name], batch.jobs)
}
BATCH = f"{RESULTS}/batches/{{batch}}"
KEPT = STUDY.keep == "replicates"
WRITTEN = {
    "moments": f"{RESULTS}/parts/{{part}}/moments.parquet",
    **(
        {"estimates": f"{RESULTS}/estimates/{{part}}.parquet"}
        if KEPT
        else {"sketches": f"{RESULTS}/parts/{{part}}/sketches.parquet"}
    ),
}
COLLECTED = [*TABLES, *(["rare"] if STUDY.rare else [])]
MEMORY = max(1000, round(EFFORT.memory / 1e6))
FIGURES = figure_names(STUDY)
# What figures and explorer take from the configuration; all else reaches them by the tables.
SHOWN = {"angle_unit", "gravity_mps2", "grids", "leveling", "models", "noise", "presets"}
SHOWN |= {"schemes", "sensitivity"}
DRAWN = STUDY.model_dump(mode="json", include=SHOWN)
CELL_FIGURES = [name for name in FIGURES if set(figure_tables(name)) <= {*COLLECTED}]
SENSITIVITY_FIGURES = [name for name in FIGURES if name not in CELL_FIGURES]
FINAL_TABLES = [
    *COLLECTED,
    *(["sensitivity", "shapley"] if STUDY.sensitivity else []),
    *(["claims", "claims_by_scheme"] if STUDY.paper else []),
]


wildcard_constraints:
    batch=r"\d+",
    part=r"\d+(-\d+)?",


@cache
def part_spec(part):
    """Everything that the numbers of a part depend on, as plain data."""
    shares = [share.to_dict() for share in PARTS[part]]
    return {"seed": STUDY.seed, "shares": shares, "leveling": STUDY.leveling.model_dump()}


@cache
def setup_of(part):
    """Digest of what a part depends on."""
    return setup_digest(part_spec(part))


def parts_of_batch(wildcards):
    """Files that the jobs of a batch write, in order."""
    return {
        kind: [path.format(part=part) for part in PARTS_OF[wildcards.batch]]
        for kind, path in WRITTEN.items()
    }


def batches_of_claims():
    """Batches with the cells that the sensitivity analysis and the claims use."""
    model = STUDY.sensitivity.model
    return [b for b, batch in BATCHES.items() if any(cell.model == model for cell in batch.cells)]


def parts_of_claims():
    """Moments and sketches of the cells that the claims use, and their estimates."""
    chosen = batches_of_claims()
    parts = [part for name in chosen for part in PARTS_OF[name]]
    return {
        "moments": expand(WRITTEN["moments"], part=parts),
        "sketches": expand(f"{BATCH}/sketches.parquet", batch=chosen),
        "estimates": expand(WRITTEN["estimates"], part=parts) if KEPT else [],
    }


def in_report(name):
    """A figure as the report shows it."""
    entry = get_figure(name)
    return report(
        f"{RESULTS}/figures/{name}.svg",
        category=entry.category,
        labels={"content": entry.title},
    )


def give_captions(rule):
    """Give each figure in the report the caption that its job writes beside it.

    As an argument of `report`, Snakemake would look for it where the rules are, such as on GitHub.
    """
    for figure in rule.output:
        if "report" in figure.flags:
            caption = LocalSourceFile(os.path.abspath(Path(figure).with_suffix(".rst")))
            figure.flags["report"] = figure.flags["report"]._replace(caption=caption)


def files_of_figures(names):
    """All files of figures."""
    others = [f"{RESULTS}/figures/{name}.{kind}" for name in names for kind in ("png", "rst")]
    return [*map(in_report, names), *others]


def inputs_of_figures(names):
    """Tables that figures need."""
    return {table: f"{RESULTS}/{table}.parquet" for table in figure_tables(*names)}
