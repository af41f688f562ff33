"""The gallery: a study's figures from what each says of itself, and all figures small."""

import re
from pathlib import Path

from markdown.extensions.toc import slugify
from markdown_text import page, plain

from accelstudy.study.config import read_study
from accelstudy.study.figures import figure_names, get_figure

ROOT = Path(__file__).parents[2]
PAPER = "config/config.yaml"
SHOWN = re.compile(r"^##+ (.+)\n\n!\[.*?\]\((\.\./figures/.+?\.png)\)", re.MULTILINE)


def studies():
    """Configurations that come along, and the names of the figures that each has."""
    sweeps = sorted(path.relative_to(ROOT).as_posix() for path in ROOT.glob("config/sweeps/*.yaml"))
    layers = {PAPER: (PAPER,), **{sweep: (PAPER, sweep) for sweep in sweeps}}
    return {
        name: figure_names(read_study(*(ROOT / layer for layer in of)))
        for name, of in layers.items()
    }


def study_figures():
    """All figures that a study can have."""
    made_by = {}
    for config, names in studies().items():
        for name in names:
            made_by.setdefault(name, config)
    figures = [get_figure(name) for name in made_by]
    parts = []
    for category in sorted({figure.category for figure in figures}):
        heading = "Of the paper" if category == "Paper" else "Of any study"
        own = [figure for figure in figures if figure.category == category]
        parts += [f"## {heading}", *(_figure(figure, made_by[figure.name]) for figure in own)]
    return page(*parts)


def _figure(figure, config):
    path = f"docs/figures/{figure.name}.png"
    option = "" if config == PAPER else f" --configfile {config}"
    return page(
        f"### {figure.title}",
        f"![{figure.title}](../figures/{figure.name}.png)" if (ROOT / path).exists() else "",
        plain(figure.caption),
        f"```sh\nsnakemake --cores 2{option}      # figures/{figure.name}.svg\n```",
    )


def _pages():
    """The pages of the gallery: a heading, the file, and its text."""
    yield "Figures of a study", "study.md", study_figures()
    for title, name in (("Other figures", "other.md"), ("Reports", "reports.md")):
        yield title, name, (ROOT / "docs/gallery" / name).read_text(encoding="utf-8")


def overview():
    """All figures of the gallery, small, each with a link to where it stands."""
    parts = []
    for heading, name, text in _pages():
        links = [
            f"[![]({path}){{ loading=lazy }} {title}]({name}#{slugify(title, '-')})"
            for title, path in SHOWN.findall(text)
        ]
        parts += [f"## {heading}", '<div class="small-figures" markdown>', *links, "</div>"]
    return page(*parts)
