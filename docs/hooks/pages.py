"""What pages take from the code: the comment <!-- catalogue.schemes() --> gives way to its text."""

import re
from ast import literal_eval

import catalogue
import file_formats
import gallery
import help_texts
import quotes
import schemas

MODULES = {
    module.__name__: module
    for module in (catalogue, file_formats, gallery, help_texts, quotes, schemas)
}
CALL = re.compile(r"^<!-- (\w+)\.(\w+)\((.*)\) -->$", re.MULTILINE)


def on_page_markdown(markdown, **_):
    """Put in what the code says where a page calls for it, and the numbers that the page quotes."""
    return quotes.fill(CALL.sub(_called, markdown))


def _called(call):
    module, function, arguments = call.groups()
    return getattr(MODULES[module], function)(*literal_eval(f"[{arguments}]")).strip("\n")
