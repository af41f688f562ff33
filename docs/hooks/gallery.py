"""The gallery of a study's figures, from what each says of itself."""

from pathlib import Path

from markdown_text import page, plain

from accelstudy.study.config import read_study
from accelstudy.study.figures import figure_names, get_figure

ROOT = Path(__file__).parents[2]
PAPER = ROOT / "config/config.yaml"


def study_figures():
    """All figures that a study can have, each with a configuration that has it."""
    made_by = {}
    for path in [PAPER, *sorted(ROOT.glob("config/sweeps/*.yaml"))]:
        for name in figure_names(read_study(*dict.fromkeys((PAPER, path)))):
            made_by.setdefault(name, path)
    figures = [get_figure(name) for name in made_by]
    parts = []
    for category in sorted({figure.category for figure in figures}):
        heading = "Of the paper" if category == "Paper" else "Of any study"
        own = [figure for figure in figures if figure.category == category]
        parts += [f"## {heading}", *(_figure(figure, made_by[figure.name]) for figure in own)]
    return page(*parts)


def _figure(figure, config):
    path = f"docs/figures/{figure.name}.png"
    option = "" if config == PAPER else f" --configfile {config.relative_to(ROOT)}"
    return page(
        f"### {figure.title}",
        f"![{figure.title}](../figures/{figure.name}.png)" if (ROOT / path).exists() else "",
        plain(figure.caption),
        f"```sh\nsnakemake --cores 2{option}      # figures/{figure.name}.svg\n```",
    )
