"""Pages that are made from the code while the site is built."""

import catalogue
import command_pages
import configuration_page
import file_formats
import gallery
from drawings import DRAWINGS
from markdown_text import page, table
from mkdocs.structure.files import File

from accelstudy.pages.glossary import TERMS


def terms():
    """The terms that reports explain."""
    rows = [(f"**{term}**", meaning) for term, meaning in TERMS.items()]
    return page(
        "# Terms", "What the words on reports and on these pages mean.", table(("", ""), rows)
    )


PAGES = {
    "reference/effects.md": catalogue.effects,
    "reference/noise-effects.md": catalogue.noise_effects,
    "reference/gross-errors.md": catalogue.gross_errors,
    "reference/models.md": catalogue.models,
    "reference/schemes.md": catalogue.schemes,
    "reference/approaches.md": catalogue.approaches,
    "reference/data-sheets.md": catalogue.data_sheets,
    "reference/commands.md": command_pages.commands,
    "reference/configuration.md": configuration_page.configuration,
    "reference/file-formats.md": file_formats.formats,
    "reference/tables.md": file_formats.tables,
    "reference/terms.md": terms,
    "gallery/study.md": gallery.study_figures,
}


def on_files(files, config):
    """Add the pages, the drawings, and small copies of the figures."""
    for path, make in {**PAGES, **DRAWINGS}.items():
        files.append(File.generated(config, path, content=make()))
    for path, content in gallery.thumbnails().items():
        files.append(File.generated(config, path, content=content))
    return files


def on_page_markdown(markdown, page, **_):
    """Put the small copies where the gallery has them."""
    if page.file.src_uri != "gallery/index.md":
        return markdown
    return markdown.replace("<!-- all figures, small -->", gallery.overview())
