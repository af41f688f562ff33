"""What pages take from the code, where they have a comment of its name, while the site is built."""

import re
from functools import partial

import catalogue
import command_pages
import configuration_page
import drawings
import file_formats
import gallery
import quotes
from markdown_text import table
from mkdocs.structure.files import File

from accelstudy.pages.glossary import TERMS


def terms():
    """The terms that reports explain."""
    return table(("", ""), [(f"**{term}**", meaning) for term, meaning in TERMS.items()])


PARTS = {
    "effects of the sensor": partial(catalogue.effects, "sensor"),
    "effects of the rig": partial(catalogue.effects, "rig"),
    "each effect": catalogue.each_effect,
    "noise effects": catalogue.noise_effects,
    "gross errors": catalogue.gross_errors,
    "models": catalogue.models,
    "published calibrations": catalogue.presets,
    "schemes": catalogue.schemes,
    "families of schemes": catalogue.families,
    "approaches": catalogue.approaches,
    "data sheets": catalogue.data_sheets,
    "public data": catalogue.public,
    "commands": command_pages.commands,
    "configuration": configuration_page.configuration,
    "header of a campaign": file_formats.header,
    "positions of a campaign": file_formats.positions,
    "keys of a calibration": partial(file_formats.document, "Calibration", "calibration"),
    "keys of a comparison": partial(file_formats.document, "Two calibrations", "comparison"),
    "keys of a history": partial(file_formats.document, "Several calibrations", "history"),
    "keys of a lot": partial(file_formats.document, "Lot", "lot"),
    "keys of a type": file_formats.of_type,
    "keys of a diagnosis": partial(file_formats.document, "Diagnosis", "diagnosis"),
    "priors of a diagnosis": partial(file_formats.rules, priors=True),
    "other rules of a diagnosis": partial(file_formats.rules, priors=False),
    "claims of the paper": quotes.claims,
    "terms": terms,
    "figures of a study": gallery.study_figures,
}
PLACE = re.compile(rf"^<!-- ({'|'.join(PARTS)}) -->$", re.MULTILINE)


def on_files(files, config):
    """Add the drawing of a session."""
    files.append(File.generated(config, "drawings/session.svg", content=drawings.session()))
    return files


def on_page_markdown(markdown, **_):
    """Put the parts where a page has their names, and the numbers that it quotes."""
    return quotes.fill(PLACE.sub(lambda place: PARTS[place[1]]().strip("\n"), markdown))
