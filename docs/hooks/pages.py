"""What pages take from the code: the comment <!-- catalogue.schemes() --> gives way to its text."""

import json
import re
from ast import literal_eval
from importlib import import_module
from pkgutil import walk_packages

from mkdocs.structure.files import File

import accelstudy
from accelstudy.files.documents import Document

NAMES = ("catalogue", "file_formats", "gallery", "help_texts", "quotes", "schemas")
MODULES = {name: import_module(name) for name in NAMES}
CALL = re.compile(r"^<!-- (\w+)\.(\w+)\((.*)\) -->$", re.MULTILINE)


def on_files(files, config):
    """Add the JSON Schema of each JSON file that the package writes to the reference."""
    for module in walk_packages(accelstudy.__path__, "accelstudy."):
        import_module(module.name)
    for one in Document.__subclasses__():
        if one.file.endswith(".json"):
            path = f"reference/{one.file.replace('.json', '.schema.json')}"
            content = json.dumps(one.model_json_schema(), indent=2, ensure_ascii=False)
            files.append(File.generated(config, path, content=content))
    return files


def on_page_markdown(markdown, **_):
    """Put in what the code says where a page calls for it, and the numbers that the page quotes."""
    return MODULES["quotes"].fill(CALL.sub(_called, markdown))


def _called(call):
    module, function, arguments = call.groups()
    return getattr(MODULES[module], function)(*literal_eval(f"[{arguments}]")).strip("\n")
